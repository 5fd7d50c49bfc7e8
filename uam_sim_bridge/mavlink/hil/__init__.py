"""PX4's simulator link (software in the loop) and the router for hardware in the loop."""
