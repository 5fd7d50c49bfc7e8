"""Many flights of the direct engine, in parallel: what `uam tune` and `uam compare` are made of."""
