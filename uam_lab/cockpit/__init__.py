"""The cockpit: a local web page (viser) that shows and commands a flight, over ROS only.

It uses only topics and services of running nodes, so it also works on the vehicle.
"""
