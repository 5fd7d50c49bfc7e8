"""What stands in for hardware, or talks to it: plant, sensors, faults, autopilot, MAVLink, PX4."""
