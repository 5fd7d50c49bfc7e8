"""Vehicles of many sizes for `designed.py` and the tests; see `vehicles`."""
