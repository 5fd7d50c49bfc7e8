"""Devices of the vehicle: driver and emulation side by side; nodes in `uam_sim_bridge.nodes`."""

# how a user gets the packages of the devices
INSTALL = "pip install -e '.[hardware]' in a clone; colcon: docs/index.md"
