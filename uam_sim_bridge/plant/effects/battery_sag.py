"""Sag of the battery: less voltage, so less speed at the same command.

Rest voltage of a cell falls linearly from `full` to `empty` with the charge taken; the current
times the resistance is lost on top. The rotors' speed at a command is proportional to the voltage,
so their thrust to its square; the nominal thrust holds at the voltage `full` without load.
Power: P = sum(T^1.5) / sqrt(2 rho A) / figure of merit (momentum theory), plus the electronics.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record
from uam_sim_bridge.plant.effects.effect import AIR, Acting, Bench, Compiled, Effect, size

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
        charge, area = (
            noise.uniform(self.start, 1.0),
            math.pi * bench.vehicle.description.rotor.radius**2,
        )
        names = "charge current cells full empty_cell resistance electronics capacity"
        numbers = record("", f"{names} nominal per_thrust gain period")
        numbers[0] = (
            *(charge, 0.0, self.cells, self.full, self.empty),
            *(self.resistance, self.electronics, self.capacity),
            bench.rotors.constants[1],
            1.0 / (self.figure_of_merit * math.sqrt(2.0 * AIR * area)),
            *(1.0 - math.exp(-bench.period / SMOOTHING), bench.period),
        )
        arrays = BatteryArrays(bench.rotors.thrust, bench.rotors.constants, numbers)
        return Compiled(arrays, tick=discharge)


class BatteryArrays(NamedTuple):
    """thrust (rotors,) [N]; constants: of `rotor_step`; numbers (1,): state of charge, current [A],
    nominal: full thrust [N] at the voltage `full`, per_thrust: electrical power [W] / sum(T^1.5),
    gain: of the current's low-pass, period [s]; the others as in `BatterySag`."""

    thrust: np.ndarray
    constants: np.ndarray
    numbers: np.ndarray


@borrowing
def discharge(a: BatteryArrays) -> int:
    """Take the charge of a control period; set the full thrust to that at the voltage."""
    m, ideal = a.numbers[0], 0.0
    rest = m.cells * (m.empty_cell + (m.full - m.empty_cell) * m.charge)
    for thrust in a.thrust:
        ideal += thrust**1.5
    voltage = rest - m.cells * m.resistance * m.current
    m.current += m.gain * ((m.per_thrust * ideal + m.electronics) / voltage - m.current)
    m.charge = max(0.0, m.charge - m.current * m.period / (3600.0 * m.capacity))
    a.constants[1] = m.nominal * (voltage / (m.cells * m.full)) ** 2
    return 0
