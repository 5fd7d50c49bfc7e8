"""Setpoint types: each sends another part of the desired motion to the autopilot."""
