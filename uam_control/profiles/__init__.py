"""Profiles: the parameters of every node of a flight."""
