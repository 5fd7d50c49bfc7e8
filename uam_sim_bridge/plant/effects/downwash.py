"""Downwash of the rotors on the payload, on its stand or at the magnet.

Each rotor's slipstream is a round turbulent jet along the body's -z axis, with a Gaussian profile
of half-width b = b0 + S z at the distance z below the disc. Its momentum flux stays the thrust, and
at the disc's end of the contraction its velocity is that of momentum theory, 2 v_i:

    u^2 = (2 ln 2 T / (rho pi b^2)) exp(-2 ln 2 (r / b)^2),   b0 = sqrt(ln 2) R

The momentum fluxes of the rotors add up. The payload is pushed with (rho/2) C_d A sum(u^2) along
the jets; turbulence varies the velocity. The stand is fixed and does not move; it does not change
the flow, as its top (7 x 7 cm) is small against a disc.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from uam_control.maths.compiled import jit
from uam_sim_bridge.plant.effects.effect import AIR, Acting, Bench, Effect, size
from uam_sim_bridge.plant.vehicle import PAYLOAD

EDDY = 0.1  # [s] correlation time of the turbulence: some decimetres at 5 m/s
STILL = 1e-3  # [N] below this the payload is left alone, so that it can sleep


class Downwash(Effect):
    """The rotors' slipstreams push the payload, on its stand and in flight."""

    SOURCE: ClassVar[str] = (
        "round turbulent jet: Pope, Turbulent Flows, 2000, section 5.1 (spreading 0.1, turbulence "
        "25 %); merged jets only beyond 2.5 vehicle diameters: Bauersfeld et al. 2024, "
        "arXiv 2403.13321; drag of a cube: Hoerner 1965"
    )

    spreading: float = size("S, growth of the half-width per distance", "1", 0.0, 0.5)
    drag: float = size("drag coefficient of the payload", "1", 0.0, 3.0)
    turbulence: float = size("standard deviation / mean of the velocity", "1", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        return _Downwash(self, bench, noise)


class _Downwash(Acting):
    def __init__(self, p: Downwash, bench: Bench, noise: np.random.Generator) -> None:
        model, data = bench.model, bench.data
        edges = 2.0 * model.geom(PAYLOAD).size
        area = float(edges[0] * edges[1])
        self._radius = bench.vehicle.description.rotor.radius
        self._spreading, self._drag_area = p.spreading, p.drag * area
        self._turbulence, self._noise = p.turbulence, noise
        self._keep, self._eddy = math.exp(-bench.period / EDDY), 0.0
        body = model.body(PAYLOAD).id
        self._force, self._payload = data.xfrc_applied[body, 0:3], data.xpos[body]
        self._bench = bench

    def tick(self) -> None:
        bench, keep = self._bench, self._keep
        fresh = self._turbulence * math.sqrt(1.0 - keep * keep)
        self._eddy = keep * self._eddy + fresh * self._noise.standard_normal()
        flux = momentum(
            self._payload - bench.base_position,
            bench.base_axes,
            bench.positions,
            bench.rotors.thrust,
            self._radius,
            self._spreading,
        )
        force = 0.5 * AIR * self._drag_area * flux * (1.0 + self._eddy) ** 2
        if force < STILL:
            self._force[:] = 0.0
        else:
            self._force[:] = -force * bench.base_axes[2::3]


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
