"""Draws the frames of docs/hardware.md: python docs/draw_mocap.py [picture.png]"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from draw_frames import BLUE, GREEN, GREY, RED, arrow, save, tripod
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Circle

PICTURE = Path(__file__).parent / "images" / "mocap_frames.png"


def vehicle(axes: Axes, at: tuple, heading: float, strength: float) -> None:
    """Draw the vehicle from above, its arms in front red."""
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    for x, y in ((0.3, 0.3), (0.3, -0.3), (-0.3, 0.3), (-0.3, -0.3)):
        end = np.array(at) + turn @ np.array([x, y])
        axes.plot([at[0], end[0]], [at[1], end[1]], color="black", lw=3, alpha=strength)
        color = RED if x > 0 else GREY
        axes.add_patch(Circle(end, 0.17, fill=False, color=color, lw=2, alpha=strength))


def places(axes: Axes) -> None:
    """Draw the two places of the calibration from above."""
    heading = np.radians(25.0)
    nose = np.array([np.cos(heading), np.sin(heading)])
    first, second = np.array([0.0, 0.0]), 1.9 * nose
    vehicle(axes, tuple(first), heading, 0.45)
    vehicle(axes, tuple(second), heading, 1.0)
    arrow(axes, tuple(first + 0.45 * nose), tuple(0.95 * nose), "black", "")
    axes.text(0.15, 0.95, "straight ahead,\n0.5 m or more", fontsize=9.5)
    axes.text(0.0, -0.75, "first place, level", ha="center", fontsize=10, color=GREY)
    axes.text(
        second[0] + 0.3, second[1] - 0.75, "second place", ha="center", fontsize=10, color=GREY
    )
    arrow(axes, tuple(second), tuple(0.75 * nose), RED, "x nose")
    arrow(axes, tuple(second), tuple(0.6 * np.array([-nose[1], nose[0]])), GREEN, "y")


def side(axes: Axes) -> None:
    """Draw the vehicle on the floor from its right side: base_link, pivot, height."""
    axes.plot([-1.2, 1.4], [0.0, 0.0], color=GREY, lw=2)
    axes.plot([-0.8, 0.8], [0.7, 0.7], color="black", lw=5)
    for x in (-0.45, 0.45):
        axes.plot([0.5 * x, x], [0.7, 0.0], color="black", lw=2)
    markers = ((-0.45, 0.95), (0.1, 1.2), (0.62, 0.92))
    for at in markers:
        axes.plot(at[:1], at[1:], "o", color=GREY, ms=9)
        axes.plot([at[0], at[0]], [0.7, at[1]], color=GREY, lw=1)
    pivot = np.mean(markers, axis=0)
    arrow(axes, (0.0, 0.7), (0.75, 0.0), RED, "x")
    arrow(axes, (0.0, 0.7), (0.0, 0.8), BLUE, "z")
    axes.plot(*pivot, "D", color=GREEN, ms=8)
    axes.text(pivot[0] + 0.12, pivot[1] + 0.02, "pivot", color=GREEN, fontsize=10)
    axes.plot(0.0, 0.7, "s", color="black", ms=8)
    axes.text(0.0, 0.52, "base_link", ha="center", fontsize=10)
    way = {"arrowstyle": "<->", "color": BLUE}
    axes.annotate("", (-1.0, 0.0), (-1.0, 0.7), arrowprops=way)
    axes.text(-1.06, 0.35, "standing\nheight", ha="right", va="center", fontsize=9, color=BLUE)
    axes.text(0.1, -0.3, "on the floor, from the right", ha="center", fontsize=10, color=GREY)


def draw(file: Path) -> None:
    """Write the picture."""
    figure, (first, second, third) = plt.subplots(
        1, 3, figsize=(13.0, 3.6), width_ratios=(1.25, 1.0, 1.2)
    )
    tripod(first, (0.0, 0.0), "Motive, Y up", ("x", "-z", "y"))
    tripod(first, (2.0, 0.0), "Motive, Z up", ("x", "y", "z"))
    tripod(first, (4.0, 0.0), "world, ENU", ("x", "y", "z"))
    first.text(2.0, 1.55, "Y up, the default: (x, y, z) → (x, −z, y)", ha="center", fontsize=10.5)
    first.set(xlim=(-0.9, 5.1), ylim=(-1.2, 1.8), aspect="equal")
    side(second)
    second.set(xlim=(-1.6, 1.6), ylim=(-0.5, 1.8), aspect="equal")
    places(third)
    third.set(xlim=(-0.8, 3.0), ylim=(-1.0, 2.0), aspect="equal")
    save(figure, file)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
