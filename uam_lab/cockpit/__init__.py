"""The cockpit: a local web page (viser) that shows a flight and steers it, over ROS alone.

It knows nothing of the plant: what it shows are the topics of nodes that run, on the vehicle too.
"""
