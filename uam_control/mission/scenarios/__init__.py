"""Scenarios: files, curves and routes, and the pieces that they are put together from."""
