"""Picture of an identified joint: friction torque over velocity, measured and fitted."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from uam_lab.report.figures import style
from uam_sim_bridge.devices.dynamixel.friction_fit import FrictionFit

SHOWN = 4000  # dots


def draw(file: Path, joint: str, fit: FrictionFit) -> None:
    """Write the picture as PNG."""
    with style.styled():
        figure = Figure(figsize=(7.0, 4.5), layout="constrained")
        axes = figure.subplots()
        every = max(1, len(fit.velocity) // SHOWN)
        dots = {"color": style.FLIGHTS[0], "markersize": 2, "label": "measured"}
        axes.plot(fit.velocity[::every], fit.torque[::every], ".", **dots)
        fastest = float(np.max(np.abs(fit.velocity)))
        label = f"{fit.coulomb:.3f} N m and {fit.viscous:.4f} N m s/rad"
        for speeds in (np.array([-fastest, -1e-6]), np.array([1e-6, fastest])):
            fitted = fit.coulomb * np.sign(speeds) + fit.viscous * speeds
            axes.plot(speeds, fitted, color=style.INK, linewidth=1.5, label=label)
            label = None
        scale = f"torque scale {fit.scale:.3f}" if fit.scale_known else "torque scale unknown"
        axes.set_title(f"{joint}: friction, {scale}", loc="left")
        axes.set_xlabel("velocity [rad/s]")
        axes.set_ylabel("torque without weight and inertia [N m]")
        axes.legend()
        style.save(figure, file)
