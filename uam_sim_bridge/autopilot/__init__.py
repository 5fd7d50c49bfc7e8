"""PX4-class autopilot stand-in: rate loop, allocation, arming and OFFBOARD rules, server."""
