"""Rehearsal: the nodes of the vehicle, with the same lab file, on emulated devices."""
