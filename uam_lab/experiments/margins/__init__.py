"""Stability margins of the loops, from a linear model of the objects that fly; see `loops`."""
