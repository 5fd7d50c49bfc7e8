"""The electromagnet: what its switch does without commands, and a GPIO line."""
