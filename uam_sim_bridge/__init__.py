"""MuJoCo plant, MAVLink bridge, autopilot stand-in, flights and reports."""
