"""Figures of a flight."""
