"""Setpoint types: what of a desired motion goes to the autopilot."""
