"""The loops of the stack, each opened alone while the others are closed, and their margins.

| loop | opened at |
|---|---|
| roll, pitch, yaw | body-rate setpoint, on its way to the autopilot |
| x, y, z | estimated position and velocity, before the position law |
| joints | estimated angle and velocity, before the arm law |
| setpoints | the four values of the setpoint together: delay margin only |
| hand | the correction of the arm's reference, if the hand is stabilised: delay margin only |
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ARM, POSITION
from uam_lab.experiments.margins.linear import (
    IN,
    TINY,
    LinearBlock,
    Margins,
    common_delay,
    join,
    margins,
)
from uam_lab.experiments.margins.stack_model import RATES, THRUST, Stack, hand_signals

LOWEST, FREQUENCIES = 0.05, 1200  # [rad/s] and number, up to half the tick rate
GROWTH = 1e-3  # [1/s] of a mode that counts as unstable


class GrowingMode(NamedTuple):
    """A mode of the closed system: growth [1/s], negative if it decays, at a frequency [rad/s]."""

    growth: float
    frequency: float


@dataclass(frozen=True)
class Analysis:
    """Margins of all loops of a stack at one operating point."""

    omega: np.ndarray  # (k,) [rad/s]
    loops: dict[str, tuple[np.ndarray, Margins]]  # name → L (k,), margins
    setpoint_delay: float  # [s] by which the whole setpoint may come later
    hand_delay: float | None  # [s] by which the correction of the hand may, None: it is off
    mode: GrowingMode  # the fastest-growing one
    closed: LinearBlock  # the closed system, with inputs IN + signal that are added

    @property
    def stable(self) -> bool:
        """Return whether no mode grows."""
        return self.mode.growth < GROWTH


def loops_of(coordinates: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return coordinate of chi → the signals that are opened together for its loop.

    One scalar goes through the signals: tau of the coordinate, or its body-rate setpoint.
    """
    by_state = (*coordinates[POSITION], *coordinates[ARM])
    rates = {name.partition(".")[2]: (name,) for name in RATES}
    return rates | {name: (f"state.{name}", f"state.{name}_dot") for name in by_state}


def analyse(stack: Stack) -> Analysis:
    loops = loops_of(stack.coordinates)
    driven = {name for block in stack.blocks for name in block.outputs}
    hand = [name for name in hand_signals(stack.coordinates[ARM]) if name in driven]
    signals = [*dict.fromkeys(s for loop in loops.values() for s in loop), THRUST, *hand]
    steps = [f"state.{name}" for name in stack.coordinates]
    added = list(dict.fromkeys(signals + steps))
    whole = join(stack.blocks, added=added)
    nyquist = math.pi / stack.period
    omega = np.geomspace(LOWEST, nyquist * (1.0 - 1e-6), FREQUENCIES)
    z = np.exp(1j * omega * stack.period)
    # signal = -T (what is added to it), T = (1 + L)^-1 L: L of any set of signals follows
    closed = -whole.only([IN + name for name in signals], signals).response(z)

    def opened(names: Sequence[str]) -> np.ndarray:
        """Return the return matrices (k, m, m) of the signals `names`."""
        at = [signals.index(name) for name in names]
        t = closed[:, at][:, :, at]
        return t @ np.linalg.inv(np.eye(len(at)) - t)

    found = {}
    for coordinate, loop in loops.items():
        # one scalar goes through the signals, and 1 + L is the determinant
        value = np.linalg.det(np.eye(len(loop)) + opened(loop)) - 1.0
        found[coordinate] = value, margins(omega, value)
    return Analysis(
        omega,
        found,
        common_delay(omega, opened((*RATES, THRUST))),
        common_delay(omega, opened(hand)) if hand else None,
        fastest_mode(stack),
        whole.only([IN + name for name in added], whole.outputs),
    )


def fastest_mode(stack: Stack) -> GrowingMode:
    """Return the mode of the closed system that grows fastest, or decays slowest."""
    pole = max(np.linalg.eigvals(join(stack.blocks).a), key=abs)
    return GrowingMode(
        math.log(max(abs(pole), TINY)) / stack.period, abs(cmath.phase(pole)) / stack.period
    )


def step_response(
    stack: Stack, analysis: Analysis, coordinate: str, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return time (k,) [s] and the true coordinate (k,) after a unit step of its desired value.

    The step acts through the feedback alone: the reference has no feedforward.
    """
    count = round(duration / stack.period)
    name = f"state.{coordinate}"
    block = analysis.closed.only([IN + name], [f"true.{coordinate}"])
    return stack.period * np.arange(count), block.simulate(-np.ones((count, 1)))[:, 0]
