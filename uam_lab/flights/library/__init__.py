"""Flights from Python: `Flight` starts the nodes, commands them, and returns the result."""
