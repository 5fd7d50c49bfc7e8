"""What the autopilot reports: health, events, parameters, time."""
