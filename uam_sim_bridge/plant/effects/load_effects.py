"""Effects of masses and loads: another mass, a load that stands still, the downwash on the payload.

Downwash. Each rotor's slipstream is a round turbulent jet along the body's -z axis, with a Gaussian
profile of half-width b = b0 + S z at the distance z below the disc. Its momentum flux stays the
thrust, and at the disc's end of the contraction its velocity is that of momentum theory, 2 v_i:

    u^2 = (2 ln 2 T / (rho pi b^2)) exp(-2 ln 2 (r / b)^2),   b0 = sqrt(ln 2) R

The momentum fluxes of the rotors add up. The payload is pushed with (rho/2) C_d A sum(u^2) along
the jets; turbulence varies the velocity. The stand is fixed and does not move; it does not change
the flow, as its top (7 x 7 cm) is small against a disc.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, jit
from uam_sim_bridge.plant.effects.effect import AIR, Acting, Bench, Compiled, Effect, several, size
from uam_sim_bridge.plant.sensors import Noise, NoiseArrays, next_row
from uam_sim_bridge.plant.vehicle import BASE, PAYLOAD, vary


class MassMismatch(Effect):
    """Masses, inertias and centre of mass of base and arm are not the vehicle file's."""

    SOURCE = (
        "stress plant of the T650, FSC-Lab, its config A: base and inertia 1.1, arm 1.05, "
        "10, 10 and 5 mm; laboratory: half of them, an assumption: scales weigh to 1 %"
    )

    base: float = size("mass of the base / the vehicle file's", "1", 0.5, 2.0)
    inertia: float = size("inertia of the base / the vehicle file's", "1", 0.3, 3.0)
    arm: float = size("mass and inertia of the arm / the vehicle file's", "1", 0.5, 2.0)
    shift: tuple[float, ...] = several("of the base's centre of mass: x, y, z", "m", -0.1, 0.1)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        vary(bench.model, (self.base, self.arm), (self.inertia / self.base, 1.0), self.shift)


class StandingLoad(Effect):
    """A constant force and a constant torque act on the base, at its centre of mass."""

    SOURCE = (
        "six flights of the T650, FSC-Lab: force 0.74 N on 3.75 kg, constant in the body on "
        "circles, torque -0.07 to -0.13 N m about z [wb 1.1-1.6]; laboratory: the same per mass"
    )

    force: tuple[float, ...] = several("x, y, z", "N", -20.0, 20.0)
    torque: tuple[float, ...] = several("about x, y, z", "N m", -5.0, 5.0)
    turning: float = size("1: both turn with the body (FLU), 0: they do not (ENU)", "1", 0.0, 1.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        applied = bench.data.xfrc_applied[bench.model.body(BASE).id]
        load = np.array([self.force, self.torque])
        return Compiled((applied, bench.base_axes, load, self.turning), tick=press)


@borrowing
def press(a: tuple) -> int:
    """Add the force to that on the base, which has the drag already; set the torque.

    applied (6,) [N, N m, ENU]: on the base; axes (9,): body → world, row by row; load (2, 3);
    turning: 0 to 1, its part in the body's axes.
    """
    applied, axes, load, turning = a
    for i in range(3):
        applied[3 + i] = 0.0
        for kind in range(2):
            value = (1.0 - turning) * load[kind, i]
            for k in range(3):
                value += turning * axes[3 * i + k] * load[kind, k]
            applied[3 * kind + i] += value
    return 0


EDDY = 0.1  # [s] correlation time of the turbulence: some decimetres at 5 m/s
STILL = 1e-3  # [N] below this the payload is left alone, so that it can sleep


class Downwash(Effect):
    """The rotors' slipstreams push the payload, on its stand and in flight."""

    SOURCE = (
        "round turbulent jet: Pope, Turbulent Flows, 2000, section 5.1 (spreading 0.1, turbulence "
        "25 %); merged jets only beyond 2.5 vehicle diameters: Bauersfeld et al. 2024, "
        "arXiv 2403.13321; drag of a cube: Hoerner 1965"
    )

    spreading: float = size("S, growth of the half-width per distance", "1", 0.0, 0.5)
    drag: float = size("drag coefficient of the payload", "1", 0.0, 3.0)
    turbulence: float = size("standard deviation / mean of the velocity", "1", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        body, edges = bench.model.body(PAYLOAD).id, 2.0 * bench.model.geom(PAYLOAD).size
        keep = math.exp(-bench.period / EDDY)
        eddies = Noise(noise, np.array([self.turbulence * math.sqrt(1.0 - keep * keep)]))
        arrays = DownwashArrays(
            *(bench.data.xpos[body], bench.data.xfrc_applied[body, 0:3], np.zeros(3)),
            *(bench.base_position, bench.base_axes, bench.positions, bench.rotors.thrust),
            *(eddies.arrays, np.zeros(1)),
            *(bench.vehicle.description.rotor.radius, self.spreading, keep),
            0.5 * AIR * self.drag * float(edges[0] * edges[1]),
        )
        return Compiled(arrays, [eddies], tick=push)


@jit
def momentum(
    offset: np.ndarray,
    axes: np.ndarray,
    positions: np.ndarray,
    thrust: np.ndarray,
    radius: float,
    spreading: float,
) -> float:
    """Return the sum of u^2 [m^2/s^2] of the jets at a point.

    offset (3,) [m, ENU]: point - base; axes (9,): body → world, row by row; positions (rotors, 3)
    [m, FLU]; thrust (rotors,) [N]; radius [m] of the discs.
    """
    point = np.zeros(3)
    for k in range(3):
        for i in range(3):
            point[k] += axes[3 * i + k] * offset[i]
    total = 0.0
    for i in range(len(thrust)):
        below = positions[i, 2] - point[2]
        if below <= 0.0:
            continue
        across = (point[0] - positions[i, 0]) ** 2 + (point[1] - positions[i, 1]) ** 2
        width = math.sqrt(math.log(2.0)) * radius + spreading * below
        squared = width * width
        centre = 2.0 * math.log(2.0) * thrust[i] / (AIR * math.pi * squared)
        total += centre * math.exp(-2.0 * math.log(2.0) * across / squared)
    return total


class DownwashArrays(NamedTuple):
    """What `push` uses; base to thrust, radius and spreading: see `momentum`."""

    payload: np.ndarray  # (3,) [m, ENU]
    force: np.ndarray  # (3,) [N, ENU] on the payload
    offset: np.ndarray  # (3,) [m] for `push`
    base: np.ndarray
    axes: np.ndarray
    positions: np.ndarray
    thrust: np.ndarray
    eddies: NoiseArrays  # white noise
    eddy: np.ndarray  # (1,) the present eddy's part of the mean velocity
    radius: float
    spreading: float
    keep: float  # of an eddy in a tick
    pressure: float  # [kg/m] force / u^2


@borrowing
def push(a: DownwashArrays) -> int:
    """Set the force on the payload for a control period."""
    a.eddy[0] = a.keep * a.eddy[0] + a.eddies.rows[next_row(a.eddies), 0]
    for i in range(3):
        a.offset[i] = a.payload[i] - a.base[i]
    flux = momentum(a.offset, a.axes, a.positions, a.thrust, a.radius, a.spreading)
    force = a.pressure * flux * (1.0 + a.eddy[0]) ** 2
    for i in range(3):
        a.force[i] = -force * a.axes[3 * i + 2] if force >= STILL else 0.0
    return 0
