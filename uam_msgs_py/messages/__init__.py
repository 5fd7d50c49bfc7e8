"""Topics, and conversion between messages and arrays."""
