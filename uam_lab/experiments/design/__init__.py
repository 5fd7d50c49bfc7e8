"""Design of a vehicle's gains from its numbers, held against the margins model; see `search`."""
