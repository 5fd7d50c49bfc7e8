"""MAVLink byte transports: UDP, TCP and serial lines, with queues and pacing."""
