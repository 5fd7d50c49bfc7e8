"""The stages of a control tick on the autopilot's side, and the whole tick."""
