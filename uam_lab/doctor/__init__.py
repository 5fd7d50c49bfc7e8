"""`uam doctor`: is everything here that a flight needs, and what to do where it is not.

One module per group of checks; each has `checks(...)`, which yields findings and raises nothing.
What may hang or take its process with it (ROS, OpenGL) runs in a child with a time limit.
"""
