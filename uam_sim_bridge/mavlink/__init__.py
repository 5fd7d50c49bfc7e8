"""The MAVLink side: frames, thrust curve, body-rate setpoints, offboard link, simulator link."""
