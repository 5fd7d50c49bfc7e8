"""Drivers of the vehicle's devices: plain objects; the nodes are in `uam_sim_bridge.nodes`."""
