"""Sag of the battery: less voltage, so less speed at the same command.

Rest voltage of a cell falls linearly from `full` to `empty` with the charge taken; the current
times the resistance is lost on top. The rotors' speed at a command is proportional to the voltage,
so their thrust to its square; the nominal thrust holds at the voltage `full` without load.
Power: P = sum(T^1.5) / sqrt(2 rho A) / figure of merit (momentum theory), plus the electronics.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from uam_sim_bridge.plant.effects.effect import AIR, Acting, Bench, Effect, size

SMOOTHING = 0.1  # [s] of the current: the voltage follows the load after capacitors and ESCs


class BatterySag(Effect):
    """The battery's voltage falls with charge and current, and with it the thrust."""

    SOURCE: ClassVar[str] = (
        "PX4 v1.16: BAT1_V_CHARGED 4.05 V, BAT1_V_EMPTY 3.6 V, 5 mOhm per cell as typical in its "
        "guide to battery estimation; 4S 5000 mAh of the S-500 class; figure of merit 0.6: Bangura "
        "et al. 2016"
    )

    cells: float = size("cells in series", "1", 1.0, 14.0)
    capacity: float = size("charge from full to empty", "A h", 0.1, 100.0)
    full: float = size("rest voltage of a full cell", "V", 3.0, 4.5)
    empty: float = size("rest voltage of an empty cell", "V", 2.5, 4.2)
    resistance: float = size("of a cell with its share of cables", "Ohm", 0.0, 0.1)
    figure_of_merit: float = size("ideal / electrical power of a rotor", "1", 0.1, 1.0)
    electronics: float = size("power of computer, servos and magnet", "W", 0.0, 200.0)
    start: float = size("state of charge at the start, the least", "1", 0.1, 1.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        return _Battery(self, bench, noise.uniform(self.start, 1.0))


class _Battery(Acting):
    def __init__(self, p: BatterySag, bench: Bench, charge: float) -> None:
        self._p, self._bench, self._charge = p, bench, charge
        self._nominal = bench.rotors.constants[1]
        area = math.pi * bench.vehicle.description.rotor.radius**2
        self._per_thrust = 1.0 / (p.figure_of_merit * math.sqrt(2.0 * AIR * area))
        self._current = 0.0
        self._gain = 1.0 - math.exp(-bench.period / SMOOTHING)

    def tick(self) -> None:
        p, bench = self._p, self._bench
        rest = p.cells * (p.empty + (p.full - p.empty) * self._charge)
        power = self._per_thrust * float(np.sum(bench.rotors.thrust**1.5)) + p.electronics
        voltage = rest - p.cells * p.resistance * self._current
        self._current += self._gain * (power / voltage - self._current)
        used = self._current * bench.period / (3600.0 * p.capacity)
        self._charge = max(0.0, self._charge - used)
        bench.rotors.constants[1] = self._nominal * (voltage / (p.cells * p.full)) ** 2
