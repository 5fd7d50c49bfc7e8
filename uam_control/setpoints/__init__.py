"""From the laws' wrench to the autopilot's setpoint: thrust curve, kinds of setpoints, delay."""
