"""Control laws as plain numeric objects: no ROS, no clock, no files."""
