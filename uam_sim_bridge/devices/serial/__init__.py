"""A serial line between two programs, without hardware."""
