"""Many flights in parallel, for `uam campaign`, `uam faults`, `uam tune` and `uam compare`."""
