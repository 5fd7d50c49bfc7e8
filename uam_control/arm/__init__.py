"""The arm: a serial chain of hinges, its numbers, its compiled kinematics and dynamics."""
