"""The ROS engine: every node is a process of its own."""
