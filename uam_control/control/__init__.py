"""The three controllers, their limits, and the desired attitude that follows from tau_p."""
