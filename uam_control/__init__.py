"""Adaptive control, state estimation and missions for aerial manipulators."""
