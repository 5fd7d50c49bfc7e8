"""The ROS engine: each node runs in a separate process."""
