"""Driver of an arm of Dynamixel X-series servos, Protocol 2.0."""
