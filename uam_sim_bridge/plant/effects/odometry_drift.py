"""An odometry in place of the motion capture: its frame drifts and jumps.

A pose is seen in a frame whose place and heading wander as a random walk. At a jump, as of a loop
closure, the frame moves by a given distance in a random direction, and turns, not away from the
world. The poses are then those of the source `odometry`.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.estimation.pose_anchor import PLACE, YAW, moved
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.rotations import quaternion_from_rotation_vector, quaternion_multiply
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.sensors import Noise, NoiseArrays, next_row


class OdometryDrift(Effect):
    """The poses are those of an odometry: its frame drifts, and jumps at loop closures."""

    SOURCE: ClassVar[str] = (
        "jumps of loop closures and drift of visual-inertial odometry: REP 105, Delmerico and "
        "Scaramuzza 2018, doi 10.1109/ICRA.2018.8460664; sizes: assumptions"
    )

    walk: float = size("drift: standard deviation after a second", "m", 0.0, 0.2)
    turn: float = size("the same of the heading", "rad", 0.0, 0.1)
    jumps: float = size("jumps per time", "1/s", 0.0, 1.0)
    jump: float = size("distance of a jump", "m", 0.0, 0.5)
    jump_turn: float = size("turn of a jump", "rad", 0.0, 0.3)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        walk, jumps, directions = noise.spawn(3)
        part = math.sqrt(bench.mocap.period)
        noises = (
            Noise(walk, part * np.array([self.walk, self.walk, self.walk, self.turn])),
            Noise(jumps, np.ones(1), "random"),
            Noise(directions, np.ones(PLACE)),
        )
        arrays = DriftArrays(
            bench.pose,
            *(one.arrays for one in noises),
            *(np.zeros(PLACE), self.jumps * bench.mocap.period, self.jump, self.jump_turn),
        )
        return Compiled(arrays, noises, pose=drift)


class DriftArrays(NamedTuple):
    """pose: of `Bench`; walk: noise of a step (4,); jumps: uniform noise, directions: normal (4,);
    frame (4,) [m, rad]: x, y, z and yaw of the world in that of the odometry; begins: share of the
    poses at which it jumps; jump [m], turn [rad]."""

    pose: np.ndarray
    walk: NoiseArrays
    jumps: NoiseArrays
    directions: NoiseArrays
    frame: np.ndarray
    begins: float
    jump: float
    turn: float


@borrowing
def drift(a: DriftArrays) -> int:
    """Move the frame; express the newest pose in it."""
    step, drawn = a.walk.rows[next_row(a.walk)], a.jumps.rows[next_row(a.jumps), 0]
    direction = a.directions.rows[next_row(a.directions)]
    for i in range(PLACE):
        a.frame[i] += step[i]
    if drawn < a.begins:
        jump(a.frame, direction, a.jump, a.turn)
    express(a.frame, a.pose[1:4], a.pose[4:])
    return 0


@jit
def express(frame: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Change position (3,) [m] and quaternion (4,) of the world to those in the frame (4,)."""
    place = np.zeros(PLACE)
    place[:YAW] = position
    position[:] = moved(frame, place)[:YAW]
    heading = quaternion_from_rotation_vector(np.array([0.0, 0.0, frame[YAW]]))
    quaternion[:] = quaternion_multiply(heading, quaternion)


@jit
def jump(frame: np.ndarray, direction: np.ndarray, distance: float, turn: float) -> None:
    """Let the frame (4,) jump by a distance [m] along direction (4,), of any length, or against it,
    and turn [rad], both not away from the world."""
    length = max(1e-9, math.sqrt(np.sum(direction[:YAW] ** 2)))
    move = distance / length * direction[:YAW]
    frame[:YAW] += -move if np.sum(frame[:YAW] * move) > 0.0 else move
    frame[YAW] -= math.copysign(turn, frame[YAW])
