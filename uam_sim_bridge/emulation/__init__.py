"""Emulated hardware with the real protocols, for tests and rehearsals."""
