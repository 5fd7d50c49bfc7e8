"""The three controllers, and the attitude that points the thrust."""
