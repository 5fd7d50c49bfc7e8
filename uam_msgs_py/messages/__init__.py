"""Topics, and messages <-> arrays."""
