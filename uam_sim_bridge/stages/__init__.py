"""The stages of a control tick that talk to the autopilot, and the whole tick."""
