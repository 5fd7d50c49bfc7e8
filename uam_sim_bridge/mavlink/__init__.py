"""The MAVLink side: protocol, transport, link, telemetry, offboard control, simulator link."""
