"""Processes of a flight: start, watch, signal, environment."""
