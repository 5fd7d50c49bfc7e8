"""Faults of the motion capture: dropout, freeze, jump, exchanged axes, latency, outliers, clock."""

import math
from collections import deque

import numpy as np

from uam_control.maths.rotations import quaternion_from_rotation_vector, quaternion_multiply
from uam_control.settings.parameter_set import choice, number
from uam_sim_bridge.faults.fault import Occurrence, PlantFault
from uam_sim_bridge.plant import Samples

AXES = {"xy": [1, 0, 2], "xz": [2, 1, 0], "yz": [0, 2, 1]}
Pose = tuple[float, np.ndarray, np.ndarray]  # stamp [s], position [m, ENU], quaternion [w x y z]


class PoseFault(PlantFault):
    """A fault that changes each pose: `altered`."""

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        """Return the pose as the fault changes it; None for a dropped pose."""
        raise NotImplementedError

    def sense(self, samples: Samples, now: Occurrence) -> None:
        altered = [self.altered(pose, now) for pose in samples.poses]
        samples.poses = [pose for pose in altered if pose is not None]


class MocapDropout(PoseFault):
    """No motion-capture poses arrive."""

    def sense(self, samples: Samples, now: Occurrence) -> None:
        samples.mocap = samples.payload = None

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        return None


class MocapFreeze(PoseFault):
    """The motion capture repeats its last pose, with new stamps."""

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        now.memory = now.memory or pose
        return pose[0], *now.memory[1:]


class MocapJump(PoseFault):
    """Poses are displaced and rotated, as after a shift of the origin."""

    x: float = number(0.3, "displacement along x", "m", -10.0, 10.0)
    y: float = number(0.0, "displacement along y", "m", -10.0, 10.0)
    z: float = number(0.0, "displacement along z", "m", -10.0, 10.0)
    yaw: float = number(0.0, "rotation of the attitude about z", "rad", -math.pi, math.pi)

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        stamp, position, quaternion = pose
        turn = quaternion_from_rotation_vector(np.array([0.0, 0.0, self.yaw]))
        offset = np.array([self.x, self.y, self.z])
        return stamp, position + offset, quaternion_multiply(turn, quaternion)

    def sense(self, samples: Samples, now: Occurrence) -> None:
        super().sense(samples, now)
        if samples.payload is not None:
            samples.payload = self.altered(samples.payload, now)


class MocapSwap(PoseFault):
    """Two axes of the position are exchanged, as after a wrong calibration."""

    axes: str = choice("xy", "exchanged axes", tuple(AXES))

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        stamp, position, quaternion = pose
        return stamp, position[AXES[self.axes]], quaternion


class MocapLatency(PlantFault):
    """Poses arrive later; their stamp is still that of the exposure."""

    delay: float = number(0.1, "delay added to the usual latency", "s", 0.0, 5.0)
    jitter: float = number(0.0, "largest further delay of a pose, uniform", "s", 0.0, 5.0)

    def sense(self, samples: Samples, now: Occurrence) -> None:
        time, waiting = samples.hil[0], now.memory
        if waiting is None:
            waiting = now.memory = deque()  # time [s] at which it arrives, pose
        taken, arrived = samples.poses, []
        for pose in taken:
            late = self.delay + (now.noise.uniform(0.0, self.jitter) if self.jitter else 0.0)
            waiting.append((time + late, pose))
        # as many as are taken, one at least: a burst comes one after the other
        while waiting and waiting[0][0] <= time + 1e-9 and len(arrived) < max(1, len(taken)):
            arrived.append(waiting.popleft()[1])
        samples.poses = arrived


class MocapOutliers(PoseFault):
    """Single poses are displaced in random directions."""

    share: float = number(0.05, "fraction of displaced poses", "1", 0.0, 1.0)
    distance: float = number(0.5, "displacement", "m", 0.0, 100.0)

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        stamp, position, quaternion = pose
        direction, drawn = now.noise.standard_normal(3), now.noise.random()
        if drawn < self.share:
            position = position + self.distance * direction / np.linalg.norm(direction)
        return stamp, position, quaternion


class ClockJump(PoseFault):
    """The clock of the motion-capture computer is wrong, and so are the stamps."""

    step: float = number(0.5, "error of the clock, positive if ahead", "s", -100.0, 100.0)

    def altered(self, pose: Pose, now: Occurrence) -> Pose | None:
        stamp = pose[0] + self.step
        return (stamp, *pose[1:]) if stamp >= 0.0 else None  # no message has a stamp below zero
