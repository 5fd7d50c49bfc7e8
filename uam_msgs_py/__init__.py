"""The ROS side of all packages: topics, message conversion, parameters, base class of nodes."""
