"""Topics, message conversion, ROS parameters and the base of the nodes."""
