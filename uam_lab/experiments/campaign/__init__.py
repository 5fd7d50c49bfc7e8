"""Random flights around the nominal one, for `uam campaign`."""
