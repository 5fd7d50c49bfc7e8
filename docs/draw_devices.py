"""Draws the frames of servos and autopilot: python docs/draw_devices.py [arm.png autopilot.png]

For docs/hardware.md and docs/autopilot.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from draw_frames import BLUE, GREEN, GREY, RED, arrow, save
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, Rectangle

from uam_control.vehicle import load_description

IMAGES = Path(__file__).parent / "images"
PICTURES = (IMAGES / "arm_frames.png", IMAGES / "autopilot_frames.png")
COUNTS = 4096  # a turn
RADIUS = 0.9
SPIN = 0.2  # [m] radius of a drawn rotor


def horn(axes: Axes, direction: int) -> None:
    """Draw a servo from its horn's side, as seen from the right of the vehicle."""
    axes.add_patch(Rectangle((-0.3, -0.28), 0.6, 0.75, fill=False, color="black", lw=2))
    axes.add_patch(Circle((0.0, 0.0), 0.16, color=GREY))
    for quarter in range(4):
        angle = np.pi / 2 * quarter  # of the joint: forward, from straight down
        way = np.array([np.sin(angle), -np.cos(angle)])
        counts = (COUNTS // 2 + direction * quarter * COUNTS // 4) % COUNTS
        axes.plot(*np.outer(way, (0.98, 1.08)), color=GREY, lw=2)
        axes.text(*(1.3 * way), f"{counts}", ha="center", va="center", fontsize=10.5)
    axes.plot([0.0, 0.0], [0.0, -RADIUS], color=GREY, lw=1.2, ls="--")
    alpha = np.radians(40.0)
    tip = RADIUS * np.array([np.sin(alpha), -np.cos(alpha)])
    axes.plot([0.0, tip[0]], [0.0, tip[1]], color="black", lw=6, solid_capstyle="round")
    axes.add_patch(Arc((0, 0), 1.2, 1.2, theta1=-90.0, theta2=-50.0, color=RED, lw=2))
    axes.text(0.36, -0.86, "α > 0", color=RED, fontsize=12)
    arrow(axes, (0.75, 0.55), (0.5, 0.0), RED, "x")
    arrow(axes, (0.75, 0.55), (0.0, 0.5), BLUE, "z")
    sign = "grow" if direction > 0 else "fall"
    text = f"direction: {direction}, zero: 2048\ncounts {sign} as the link swings forward"
    axes.text(0.0, -1.75, text, ha="center", va="center", fontsize=10, color=GREY)


def rotors(axes: Axes) -> None:
    """Draw the vehicle from above: numbers and directions of the motors, two body frames."""
    for number, rotor in enumerate(load_description().rotors, 1):
        ahead, left, _ = rotor.position
        at = np.array([-left, ahead])  # on the page: nose up, left to the left
        axes.plot([0.0, 0.75 * at[0]], [0.0, 0.75 * at[1]], color="black", lw=4, zorder=0)
        color = RED if ahead > 0.0 else GREY
        axes.add_patch(Circle(at, SPIN / 2, fill=False, color=color, lw=2))
        axes.text(*at, f"{number}", ha="center", va="center", fontsize=13, weight="bold")
        outer = 1.0 if ahead > 0.0 else -1.0  # above the front rotors, below those behind
        begin, end = (20.0, 110.0) if outer > 0.0 else (-160.0, -70.0)
        if not rotor.counter_clockwise:
            begin, end = 180.0 * outer - begin, 180.0 * outer - end
        size = 0.72 * SPIN
        points = [at + size * np.array([np.cos(a), np.sin(a)]) for a in np.radians([begin, end])]
        axes.annotate(
            "",
            xy=points[1],
            xytext=points[0],
            arrowprops={
                "arrowstyle": "-|>",
                "color": BLUE,
                "lw": 1.8,
                "connectionstyle": f"arc3,rad={0.45 if rotor.counter_clockwise else -0.45}",
            },
        )
        word = "CCW" if rotor.counter_clockwise else "CW"
        below = at - [0.0, 0.66 * outer * SPIN]
        axes.text(*below, word, ha="center", va="center", fontsize=9, color=BLUE)
    axes.add_patch(Rectangle((-0.045, -0.06), 0.09, 0.12, color=GREY))
    arrow(axes, (0.0, 0.06), (0.0, 0.2), RED, "")
    axes.text(0.02, 0.3, "nose", color=RED, fontsize=10)


def body(axes: Axes) -> None:
    """Draw the body frames of ROS and of PX4 side by side, from above."""
    for at, title, side, up in (
        (0.0, "base_link and this stack: FLU\nz up, out of the page", -1.0, "•"),
        (2.6, "PX4: FRD\nz down, into the page", 1.0, "×"),
    ):
        arrow(axes, (at, 0.0), (0.0, 0.9), RED, "x")
        arrow(axes, (at, 0.0), (0.9 * side, 0.0), GREEN, "y")
        axes.add_patch(Circle((at, 0.0), 0.1, fill=False, color=BLUE, lw=2))
        axes.text(at, -0.01, up, color=BLUE, ha="center", va="center", fontsize=13)
        axes.text(at - 0.3 * side, -0.25, "z", color=BLUE, fontsize=12, weight="bold", ha="center")
        axes.text(at, -0.75, title, ha="center", fontsize=10, color=GREY)
    axes.text(1.3, 1.45, "(x, y, z) → (x, −y, −z)", ha="center", fontsize=11)


def panels(limits: list[tuple[tuple, tuple]], size: tuple) -> tuple:
    """Return figure and axes with equal scales; limits: of x and y of each."""
    figure, found = plt.subplots(1, len(limits), figsize=size)
    for axes, (wide, high) in zip(found, limits, strict=True):
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_xlim(wide)
        axes.set_ylim(high)
    return figure, found


def draw(arm: Path = PICTURES[0], autopilot: Path = PICTURES[1]) -> None:
    """Write both pictures."""
    figure, found = panels([((-1.9, 1.9), (-2.1, 1.5))] * 2, (9.5, 4.4))
    for axes, direction in zip(found, (1, -1), strict=True):
        horn(axes, direction)
    save(figure, arm)
    figure, found = panels([((-0.42, 0.42), (-0.45, 0.42)), ((-1.6, 4.2), (-1.6, 2.0))], (9.5, 4.4))
    rotors(found[0])
    body(found[1])
    save(figure, autopilot)


if __name__ == "__main__":
    draw(*map(Path, sys.argv[1:3]))
