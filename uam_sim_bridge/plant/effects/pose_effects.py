"""Effects of the motion capture: rate and noise, wrong stamps, losses; an odometry in its place.

Odometry. A pose is seen in a frame whose place and heading wander as a random walk. At a jump, as
of a loop closure, the frame moves by a given distance in a random direction, and turns, not away
from the world. The poses are then those of the source `odometry`.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.estimation.pose_anchor import PLACE, YAW, moved
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.rotations import quaternion_from_rotation_vector, quaternion_multiply
from uam_control.vehicle.loading import LARGEST_RATE, LEAST_RATE
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, size
from uam_sim_bridge.plant.sensors import Noise, next_row


class MocapFeed(Effect):
    """Rate, noise and delay of the motion capture are not the vehicle file's.

    Above the rate of the ticks several poses are taken in a tick, each of its own time.
    """

    SOURCE = (
        "FSC-Lab: 60 Hz, 0.5 mm [wb 1.1-1.6]; OptiTrack: 30 to 360 Hz; laboratory: that of the "
        "vehicle file but the noise, which is FSC-Lab's"
    )

    rate: float = size("of the poses", "Hz", LEAST_RATE, LARGEST_RATE)
    position_noise: float = size("standard deviation of a pose", "m", 0.0, 0.1)
    attitude_noise: float = size("the same about each axis", "rad", 0.0, 0.2)
    latency: float = size("from exposure to arrival", "s", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        scale = bench.vehicle.numbers["sensors"]["noise_scale"]
        noises = scale * self.position_noise, scale * self.attitude_noise
        bench.mocap.feed(self.rate, round(self.latency / bench.period), noises)


class MocapJitter(Effect):
    """The stamps of the poses have errors, and the position wanders slowly."""

    SOURCE = (
        "stamps of the receiver instead of the cameras: vrpn_mocap, byu-magicc/optitrack_vrpn; "
        "noise that is not white: Skurowski and Pawlyta 2019, doi 10.3390/s19204435; sizes: "
        "assumptions"
    )

    stamp: float = size("standard deviation of the stamp's error", "s", 0.0, 0.01)
    wander: float = size("standard deviation of the slow position error", "m", 0.0, 0.02)
    wander_time: float = size("its correlation time", "s", 0.01, 1000.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        keep = math.exp(-bench.mocap.period / self.wander_time)
        error = self.wander * noise.standard_normal(3)
        step = self.wander * math.sqrt(1.0 - keep * keep)
        drawn = Noise(noise, np.array([step, step, step, self.stamp]))
        arrays = bench.pose, drawn.arrays, error, np.full(1, -np.inf), keep
        return Compiled(arrays, [drawn], pose=jitter)


@borrowing
def jitter(a: tuple) -> int:
    """Change stamp and position of the newest pose; stamps of one receiver never go back.

    noise: of the wander (3,) [m] and of a stamp [s]; error (3,) [m]: the wander, of which `keep`
    stays from pose to pose; last (1,) [s]: newest stamp.
    """
    pose, noise, error, last, keep = a
    drawn = noise.rows[next_row(noise)]
    for i in range(3):
        error[i] = keep * error[i] + drawn[i]
        pose[1 + i] += error[i]
    pose[0] = max(0.0, pose[0] + drawn[3], last[0] + 1e-6)
    last[0] = pose[0]
    return 0


class MocapDropouts(Effect):
    """Single poses are lost, and now and then all of them for some hundredths of a second."""

    SOURCE = (
        "UDP without repetition over Wi-Fi, one packet per pose; sizes: assumptions (0.5 % of the "
        "poses, one burst of 50 ms in 20 s)"
    )

    share: float = size("share of the poses lost singly", "1", 0.0, 0.9)
    bursts: float = size("bursts per time", "1/s", 0.0, 10.0)
    burst_time: float = size("mean length of a burst (exponential)", "s", 0.0, 1.0)
    longest: float = size("longest burst", "s", 0.0, 2.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        shares, lengths = noise.spawn(2)
        noises = (
            Noise(shares, np.ones(2), "random"),
            Noise(lengths, np.array([self.burst_time]), "standard_exponential"),
        )
        parts = self.share, self.bursts * bench.mocap.period, self.longest
        drawn = (one.arrays for one in noises)
        arrays = bench.pose, *drawn, bench.memory, np.full(1, -1.0), *parts
        return Compiled(arrays, noises, pose=drop)


@borrowing
def drop(a: tuple) -> int:
    """Lose the newest pose, or not.

    shares: uniform noise, lengths [s]: of bursts; status (1,): of `Bench`; until (1,) [s]: end of
    the burst; share, begins: parts of the poses; longest [s].
    """
    pose, shares, lengths, status, until, share, begins, longest = a
    drawn = shares.rows[next_row(shares)]
    length = min(longest, lengths.rows[next_row(lengths), 0])
    in_burst = pose[0] < until[0]
    if not in_burst and drawn[1] < begins:
        until[0] = pose[0] + length
        in_burst = True
    if in_burst or drawn[0] < share:
        status[0].lost = 1
    return 0


class OdometryDrift(Effect):
    """The poses are those of an odometry: its frame drifts, and jumps at loop closures."""

    SOURCE = (
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
        sizes = self.jumps * bench.mocap.period, self.jump, self.jump_turn
        arrays = bench.pose, *(one.arrays for one in noises), np.zeros(PLACE), *sizes
        return Compiled(arrays, noises, pose=drift)


@borrowing
def drift(a: tuple) -> int:
    """Move the frame; express the newest pose in it.

    walk: noise of a step (4,); jumps: uniform noise, directions: normal (4,); frame (4,) [m, rad]:
    x, y, z and yaw of the world in that of the odometry; begins: share of the poses at which it
    jumps by a distance [m] and a turn [rad].
    """
    pose, walk, jumps, directions, frame, begins, distance, turn = a
    step, drawn = walk.rows[next_row(walk)], jumps.rows[next_row(jumps), 0]
    direction = directions.rows[next_row(directions)]
    for i in range(PLACE):
        frame[i] += step[i]
    if drawn < begins:
        jump(frame, direction, distance, turn)
    express(frame, pose[1:4], pose[4:])
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
