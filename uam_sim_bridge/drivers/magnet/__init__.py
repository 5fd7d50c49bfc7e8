"""The electromagnet on a GPIO line, and what a switch does without commands."""
