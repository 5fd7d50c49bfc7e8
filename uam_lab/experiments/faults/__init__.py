"""Faults at every moment of a mission: the matrix, its flights, their outcomes."""
