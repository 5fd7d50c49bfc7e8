"""Devices of the vehicle: driver and emulation side by side; nodes in `uam_sim_bridge.nodes`."""
