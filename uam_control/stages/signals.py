"""The signals between the stages of a tick, in one process."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from uam_control.coordinates import ALPHA
from uam_control.maths.memory import Number, record
from uam_control.setpoints.setpoint_source import Setpoint

Pose = tuple[int, np.ndarray, np.ndarray]  # stamp [ns], position (3,) [m], quaternion [w x y z]
Joints = tuple[int, np.ndarray, np.ndarray, np.ndarray]  # stamp, angles, speeds, efforts (n,)
Grip = tuple[int, np.ndarray]  # stamp, opening [m] and closing force [N] of fingers (2,)
Imu = tuple[int, np.ndarray, np.ndarray]  # stamp, gyro (3,) [rad/s], specific force (3,) [m/s^2]
JOINTS, IMU, PAYLOAD, GRIP = range(4)  # sensors, of which a sample at most arrives at a tick
NOTHING = -1  # stamp of a sample that has not arrived
POSES = 8  # that arrive at a tick, at most


class SignalArrays(NamedTuple):
    """What compiled stages have of the `Signals`."""

    exposed: np.ndarray  # (POSES,) [ns] stamps in their order, NOTHING behind the last
    poses: np.ndarray  # (POSES, 7) positions and quaternions
    stamps: np.ndarray  # (4,) [ns] of the other sensors' samples
    joints: np.ndarray  # (3, n)
    imu: np.ndarray  # (2, 3)
    payload: np.ndarray  # (3,) position
    grip: np.ndarray  # (2,)
    state: np.ndarray
    reference: np.ndarray
    attitude_reference: np.ndarray
    tau_p: np.ndarray
    tau_q: np.ndarray
    numbers: np.ndarray  # (1,) stamp [ns], time [s]


@dataclass
class Signals:
    """The signals between the stages at one tick. The next tick overwrites the same arrays.

    SIZE is 6 + n for an arm of n joints. `stamp` [ns]: of the IMU sample, names the tick; `time`
    [s]: since take-off, negative before.
    """

    # estimator
    state: np.ndarray  # (3, SIZE) chi, chi_dot, chi_ddot, see `coordinates`
    # mission
    reference: np.ndarray  # (3, SIZE) chi_d, chi_d_dot, chi_d_ddot
    # laws
    tau_alpha: np.ndarray  # (n,) [N m]
    arm_command: np.ndarray  # (n,) see `ArmController.command`
    tau_p: np.ndarray  # (3,) [N, ENU]
    attitude_reference: np.ndarray  # (3, 3) rows q_d [rad], Omega_d, Omega_d_dot, FLU
    tau_q: np.ndarray  # (3,) [N m, FLU]
    memory: np.ndarray
    # samples that arrived at this tick
    poses: Sequence[Pose] = ()  # of the vehicle, in order of their stamps
    joints: Joints | None = None
    imu: Imu | None = None
    payload: Pose | None = None
    grip: Grip | None = None
    late: float = 0.0  # [s] for which the tick has waited while a process stood still
    # mission
    flying: bool = False  # whether position and attitude are controlled
    magnet: bool = False
    phase: str = ""
    # bridge
    setpoint: Setpoint = None  # as sent to the autopilot; None: no setpoint was sent

    stamp, time = Number(), Number()

    @classmethod
    def at_rest(
        cls, state: np.ndarray, command: np.ndarray | None, taus: tuple[np.ndarray, ...]
    ) -> Self:
        """Return the signals before the first tick.

        state (3, SIZE): of the estimator; command (n,): of the arm; taus: tau_p, tau_q, tau_alpha
        of the laws.
        """
        tau_p, tau_q, tau_alpha = taus
        memory = record("stamp", "time")
        memory[0] = -1, -1.0
        return cls(
            *(state, np.zeros_like(state), tau_alpha, command),
            *(tau_p, np.zeros((3, 3)), tau_q, memory),
        )

    def arrays(self) -> SignalArrays:
        """Return new arrays for samples, and those of the signals."""
        n = self.state.shape[1] - ALPHA
        return SignalArrays(
            *(np.full(POSES, NOTHING), np.zeros((POSES, 7)), np.full(4, NOTHING)),
            *(np.zeros((3, n)), np.zeros((2, 3)), np.zeros(3), np.zeros(2)),
            *(self.state, self.reference, self.attitude_reference, self.tau_p, self.tau_q),
            self.memory,
        )

    def put(self, a: SignalArrays) -> None:
        """Copy the samples into the arrays for compiled stages."""
        samples = self.joints, self.imu, self.payload, self.grip
        a.stamps[:] = [NOTHING if sample is None else sample[0] for sample in samples]
        a.exposed[:] = NOTHING
        for i, (stamp, position, quaternion) in enumerate(self.poses[-POSES:]):
            a.exposed[i], a.poses[i, :3], a.poses[i, 3:] = stamp, position, quaternion
        if self.joints is not None:
            a.joints[:] = self.joints[1:]
        if self.imu is not None:
            a.imu[:] = self.imu[1:]
        if self.payload is not None:
            a.payload[:] = self.payload[1]
        if self.grip is not None:
            a.grip[:] = self.grip[1]
