"""MAVLink link of the companion computer to the autopilot."""
