"""Friction of a joint: the torque that its motor needs beside that of the law."""

from __future__ import annotations

import math


def friction_torque(coulomb: float, viscous: float, velocity: float, speed: float) -> float:
    """Return the friction torque [N m] at a desired velocity [rad/s].

    coulomb [N m]; viscous [N m s/rad]; speed [rad/s]: width of the smooth sign, tanh(velocity /
    speed), which has no step when the desired velocity changes its sign.
    """
    return coulomb * math.tanh(velocity / speed) + viscous * velocity
