"""ROS 2 nodes of the simulation: plant, MAVLink bridge, recorder."""
