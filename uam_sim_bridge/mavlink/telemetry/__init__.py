"""Telemetry of the autopilot: health, battery, events, parameters, streams, time."""
