"""PX4 in software (SITL): find a build, run it as the autopilot of a flight, save its log."""
