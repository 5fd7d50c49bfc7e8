"""The simulator link of PX4, and the router for hardware in the loop."""
