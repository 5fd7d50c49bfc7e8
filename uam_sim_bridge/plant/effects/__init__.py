"""Effects of a real laboratory that the calm plant does not have; one file per effect."""
