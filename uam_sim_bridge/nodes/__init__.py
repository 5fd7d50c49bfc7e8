"""ROS 2 nodes of the simulation: plant and MAVLink bridge."""
