"""The link to the autopilot, from both directions."""
