"""A GPIO line without hardware."""
