"""Kinds of setpoints: body rates, attitude, position, wrench."""
