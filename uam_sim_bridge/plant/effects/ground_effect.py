"""Ground effect: more thrust at the same speed near the floor.

Method of images for the rotors of a multirotor, with the fountain between them (Sanchez-Cuevas,
Heredia, Ollero 2017, eq. (8)):

    T/T_inf = 1 / (1 - (R/4z)^2 - R^2 z / (d^2 + 4z^2)^1.5 - (R^2/2) z / (2d^2 + 4z^2)^1.5
                   - 2 R^2 K z / (b^2 + 4z^2)^1.5)

z: height of the rotor above the floor, R: its radius, d: distance to the next rotor, b: to the
opposite one, K: strength of the fountain. The formula is for four rotors; other vehicles use their
own d and b. Stand and mat count as floor at height 0.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size

LOWEST = 0.5  # [1] of the radius: the formula is not valid below


class GroundEffect(Effect):
    """Rotors near the floor make more thrust at the same speed."""

    SOURCE: ClassVar[str] = (
        "Sanchez-Cuevas, Heredia, Ollero 2017, doi 10.1155/2017/1823056: images of four rotors, "
        "fountain K = 2; single rotor: Cheeseman and Bennett 1955"
    )

    strength: float = size("factor on the gain of thrust", "1", 0.0, 3.0)
    fountain: float = size("K, strength of the fountain between the rotors", "1", 0.0, 5.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        positions = bench.positions
        apart = np.linalg.norm(positions[:, None, :2] - positions[None, :, :2], axis=2)
        radius = bench.vehicle.description.rotor.radius
        near = float(np.where(apart > 0.0, apart, np.inf).min())
        shape = np.array([radius, near, float(apart.max()), self.fountain, self.strength])
        arrays = bench.base_position, bench.base_axes, positions, shape, bench.lift
        return Compiled(arrays, tick=lift)


@borrowing
def thrust_ratio(height: float, shape: np.ndarray) -> float:
    """Return thrust / thrust far from the floor at `height` [m] of the rotor above the floor.

    shape (5,): R, d, b [m], K, strength of `GroundEffect`.
    """
    radius, near, opposite, fountain, strength = shape
    z = max(height, LOWEST * radius)
    r2, four = radius * radius, 4.0 * z * z
    loss = (radius / (4.0 * z)) ** 2
    loss += r2 * z / (near * near + four) ** 1.5
    loss += 0.5 * r2 * z / (2.0 * near * near + four) ** 1.5
    loss += 2.0 * r2 * fountain * z / (opposite * opposite + four) ** 1.5
    return 1.0 + strength * (1.0 / (1.0 - loss) - 1.0)


@borrowing
def raise_thrust(
    base: np.ndarray, axes: np.ndarray, positions: np.ndarray, shape: np.ndarray, lift: np.ndarray
) -> None:
    """Multiply lift (rotors,) by the ratio of each rotor at its own height.

    base (3,) [m, ENU]; axes (9,): body → world, row by row; positions (rotors, 3) [m, FLU]; shape:
    see `thrust_ratio`.
    """
    for i in range(len(lift)):
        height = base[2]
        for k in range(3):
            height += axes[6 + k] * positions[i, k]
        lift[i] *= thrust_ratio(height, shape)


@borrowing
def lift(a: tuple) -> int:
    """Do `raise_thrust` with the arguments `a`."""
    raise_thrust(a[0], a[1], a[2], a[3], a[4])
    return 0
