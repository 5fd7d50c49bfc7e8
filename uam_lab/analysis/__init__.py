"""After a flight: the paper's stability proof held against the simulator's truth. No ROS.

`stability.analyse` does it all; docs/stability.md says what is computed from which equation.
"""
