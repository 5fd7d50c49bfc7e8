"""`uam doctor`: check the requirements of a flight, with advice for each problem.

One module per group of checks; each has `checks(...)`, which yields findings. Checks that may hang
or crash (ROS, OpenGL) run in a child process with a time limit.
"""
