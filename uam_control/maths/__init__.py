"""Rotations, and the compilation of small fixed-size functions."""
