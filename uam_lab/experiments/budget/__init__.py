"""Where the time of a control tick goes: flown, measured, drawn."""
