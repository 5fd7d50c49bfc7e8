"""The ROS nodes: thin shells around the maths."""
