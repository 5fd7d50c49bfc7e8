"""Experiment: body-rate steps of PX4 and of the stand-in, compared."""
