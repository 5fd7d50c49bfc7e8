"""Flights of an experiment: flown by workers, each once, into a table."""
