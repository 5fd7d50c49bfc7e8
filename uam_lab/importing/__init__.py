"""Import of a vehicle from a URDF or MJCF: what it holds is found, what it cannot hold is asked."""
