"""Draws axes and joints for docs/interfaces.md: python docs/draw_frames.py [picture.png]"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

PICTURE = Path(__file__).parent / "images" / "frames.png"
RED, GREEN, BLUE, GREY = "#c0392b", "#1e8449", "#21618c", "#555555"
ALPHA = np.radians([35.0, 40.0])  # of the drawn arm
LINKS = (1.0, 0.8)


def arrow(axes: Axes, start: tuple, way: tuple, color: str, name: str) -> None:
    """Draw an arrow from start by way, with its name beyond the tip."""
    axes.annotate(
        "",
        xy=(start[0] + way[0], start[1] + way[1]),
        xytext=start,
        arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2.2},
    )
    length = np.hypot(*way)
    tip = np.add(start, np.multiply(way, (length + 0.17) / length))
    axes.text(*tip, name, color=color, ha="center", va="center", fontsize=12, weight="bold")


def tripod(axes: Axes, at: tuple, title: str, names: tuple[str, str, str]) -> None:
    """Draw three axes: to the right, into the page (drawn obliquely), and up."""
    ways = ((1.0, 0.0), (0.55, 0.45), (0.0, 1.0))
    for way, name in zip(ways, names, strict=True):
        sign, label = (-1.0, name[1:]) if name.startswith("-") else (1.0, name)
        color = {"x": RED, "y": GREEN, "z": BLUE}[label]
        arrow(axes, at, tuple(sign * np.array(way)), color, label)
    axes.text(at[0] + 0.2, at[1] - 0.75, title, ha="center", fontsize=10.5, color=GREY)


def arm(axes: Axes) -> None:
    """Draw the vehicle from its right side with two links."""
    base = np.array([0.0, 0.0])
    axes.plot([-1.0, 1.0], [0.0, 0.0], color="black", lw=6, solid_capstyle="round")
    for x in (-1.0, 1.0):
        axes.plot([x, x], [0.0, 0.16], color="black", lw=3)
        axes.plot([x - 0.35, x + 0.35], [0.17, 0.17], color=GREY, lw=3)
    arrow(axes, (0.0, 0.0), (0.0, 0.75), BLUE, "z")
    arrow(axes, (1.0, 0.0), (0.7, 0.0), RED, "x")
    axes.text(-0.12, 0.24, "base_link", ha="right", fontsize=10)
    joint, turned = base + [0.0, -0.12], 0.0
    for number, (angle, length) in enumerate(zip(ALPHA, LINKS, strict=True), 1):
        ahead = joint + 0.65 * length * np.array([np.sin(turned), -np.cos(turned)])
        axes.plot(*zip(joint, ahead, strict=True), color=GREY, lw=1, ls="--")
        begin = np.degrees(turned) - 90.0
        size = 0.9 * length
        axes.add_patch(
            Arc(joint, size, size, theta1=begin, theta2=begin + np.degrees(angle), color=RED, lw=2)
        )
        middle = turned + angle / 2.0
        text = joint + (0.5 * size + 0.13) * np.array([np.sin(middle), -np.cos(middle)])
        axes.text(*text, f"alpha_{number}", color=RED, fontsize=11, ha="right", va="top")
        turned += angle
        end = joint + length * np.array([np.sin(turned), -np.cos(turned)])
        axes.plot(*zip(joint, end, strict=True), color="black", lw=5, solid_capstyle="round")
        axes.plot(*joint, "o", color="white", mec="black", ms=9, zorder=5)
        joint = end
    axes.plot(*joint, "s", color=BLUE, ms=11, zorder=5)
    axes.text(joint[0] + 0.16, joint[1], "magnet", fontsize=10, va="center")
    axes.text(
        -0.1,
        -2.0,
        "seen from the right; dashed: alpha = 0;\nthe drawn angles are positive (forward)",
        ha="center",
        fontsize=10,
        color=GREY,
    )


def save(figure: Figure, file: Path) -> None:
    """Write a picture of drawings without scales."""
    for axes in figure.axes:
        axes.axis("off")
    figure.tight_layout()
    figure.savefig(file, dpi=90)
    plt.close(figure)


def draw(file: Path) -> None:
    """Write the picture."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), width_ratios=(1.25, 1.0))
    tripod(left, (0.0, 0.0), "Motive, up axis Y", ("x", "-z", "y"))
    tripod(left, (2.6, 0.0), "world, base_link (REP-103)", ("x", "y", "z"))
    left.text(1.7, 1.75, "(x, y, z) of Motive  →  (x, −z, y)", ha="center", fontsize=11)
    left.set(xlim=(-1.1, 4.3), ylim=(-1.1, 2.1), aspect="equal")
    arm(right)
    right.set(xlim=(-1.6, 2.4), ylim=(-2.2, 1.1), aspect="equal")
    save(figure, file)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
