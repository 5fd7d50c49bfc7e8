"""Control loops of the stand-in: position, attitude, body rates, allocation, descent."""
