"""Steps of the body-rate setpoint in hover: the experiment, whichever autopilot flies it.

During a step the setpoint of one axis is replaced by a constant; between steps the position
controller brings the vehicle back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from px4_steps.hover_flight import HoverFlight, NotFlown
from uam_control.settings import configuration

AXES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Step:
    """One step: of the rate about `axis` (0..2), `size` [rad/s] with its sign, `duration` [s]."""

    axis: int
    size: float
    duration: float


def experiment() -> dict[str, Any]:
    """config/px4/rate_steps.yaml."""
    return yaml.safe_load(configuration.path("px4/rate_steps.yaml").read_text())


def steps(numbers: Mapping[str, Any]) -> Iterator[Step]:
    """Every step of the experiment, in order."""
    for axis, name in enumerate(AXES):
        size, duration = numbers["steps"][name]
        for _ in range(numbers["repeats"]):
            yield Step(axis, size, duration)
            yield Step(axis, -size, duration)


def responses(
    flight: HoverFlight, numbers: Mapping[str, Any]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Fly; returns, per axis, time (n,) [s] from the step and the mean response (n,) to 1.

    Raises NotFlown.
    """
    period = flight.plant.period
    flight.take_off(numbers["hover_height"], numbers["climb_speed"], numbers["settle"])
    before = round(numbers["before"] / period)
    found: dict[str, list[np.ndarray]] = {name: [] for name in AXES}
    for step in steps(numbers):
        flight.hover(numbers["recover"] - numbers["before"])
        rates = [flight.tick()[step.axis] for _ in range(before)]
        rates += [
            flight.tick((step.axis, step.size))[step.axis]
            for _ in range(round(step.duration / period))
        ]
        if not flight.armed:
            raise NotFlown("the autopilot disarmed")
        found[AXES[step.axis]].append(np.array(rates) / step.size)
    return {
        name: ((np.arange(len(curves[0])) - before) * period, np.mean(curves, axis=0))
        for name, curves in found.items()
    }
