"""Processes of a flight: start, monitoring, signals, environment."""
