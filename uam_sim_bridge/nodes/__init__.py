"""ROS 2 nodes of the simulation: plant, MAVLink bridge, drivers, and the fused control process."""
