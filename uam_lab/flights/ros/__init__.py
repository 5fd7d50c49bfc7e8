"""The ROS engine: each node runs in a separate process."""

FORKER = "uam_lab.flights.ros.forker"  # module that prepares the process that forks the nodes
