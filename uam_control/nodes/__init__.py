"""The ROS nodes; each connects one stage of the control tick to topics, parameters and services."""
