"""The video of a flight."""
