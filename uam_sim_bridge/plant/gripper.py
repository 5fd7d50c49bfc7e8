"""The two-finger gripper in the plant: drive of the fingers, and its state.

A hub moves both fingers: one tendon, whose length is the opening, pulls them, an equality keeps
them alike. The drive is a Dynamixel in current-based position mode: it turns towards its goal
position with the force that its goal current allows. Contact and friction decide what is held.
"""

from __future__ import annotations

import mujoco
import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.vehicle.chain_reader import PREFIX
from uam_sim_bridge.plant.actuators import COUNTS_PER_TURN, P_GAIN_SCALE, PWM_FULL

FINGERS = f"{PREFIX}left", f"{PREFIX}right"
DRIVE = f"{PREFIX}drive"  # tendon and actuator
STIFF = 100.0  # ratio of the impedance of friction to that of the normal force: no creep


def add_drive(spec: mujoco.MjSpec, numbers: dict) -> None:
    """Add drive and ranges to the fingers; numbers: the `gripper` entry of the vehicle."""
    lever, opening = numbers["transmission"], numbers["opening"]
    tendon = spec.add_tendon(name=DRIVE)
    for name in FINGERS:
        joint = spec.joint(name)
        joint.range = [0.5 * end for end in opening]
        # half of the opening's inertia for each finger, which moves half as fast
        joint.armature = 2.0 * numbers["inertia"] / lever**2
        tendon.wrap_joint(name, 1.0)
    alike = spec.add_equality(
        name=DRIVE,
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=FINGERS[0],
        name2=FINGERS[1],
    )
    alike.data[1] = 1.0
    drive = spec.add_actuator(name=DRIVE, target=DRIVE, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    stall, gain = numbers["stall_torque"], numbers["position_p_gain"] / P_GAIN_SCALE / PWM_FULL
    stiffness = stall * gain * COUNTS_PER_TURN / (2.0 * np.pi)  # [N m/rad] of the position loop
    drive.set_to_position(stiffness / lever**2, kv=stall / numbers["no_load_speed"] / lever**2)
    drive.forcerange = [-numbers["force"], numbers["force"]]
    spec.option.impratio = STIFF


class Fingers:
    """Views of the fingers in MuJoCo's data; all of them have no entry without a gripper."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, numbers: dict | None) -> None:
        """numbers: the `gripper` entry of the vehicle, None without."""
        self.ends, self._numbers = np.zeros((0, 3)), numbers  # closed, open, step in a period [m]
        self.goal = self.opening = self.force = np.zeros(0)
        if numbers is None:
            return
        drive, tendon = model.actuator(DRIVE).id, model.tendon(DRIVE).id
        self.goal = data.ctrl[drive : drive + 1]  # [m] of the opening
        self.opening = data.ten_length[tendon : tendon + 1]  # [m] measured
        self.force = data.actuator_force[drive : drive + 1]  # [N] measured
        for name in FINGERS:
            data.joint(name).qpos = 0.5 * numbers["opening"][1]
        self.goal[0] = numbers["opening"][1]

    def pace(self, period: float) -> None:
        """Set the goal's step in a control `period` [s]."""
        if self._numbers is not None:
            self.ends = np.array([[*self._numbers["opening"], self._numbers["speed"] * period]])

    def open_to(self, opening: float) -> None:
        """Let the open end be at `opening` [m], within the stroke."""
        if self._numbers is not None:
            self.ends[0, 1] = np.clip(opening, *self._numbers["opening"])


@borrowing
def move_fingers(ends: np.ndarray, goal: np.ndarray, close: bool) -> None:
    """Move the goals (m,) towards the closed or the open end; ends: see `Fingers`."""
    for i in range(len(goal)):
        end, step = ends[i, 0] if close else ends[i, 1], ends[i, 2]
        goal[i] += min(max(end - goal[i], -step), step)


@borrowing
def write_grip(opening: np.ndarray, force: np.ndarray, row: np.ndarray) -> None:
    """Write opening [m] and closing force [N] to row (2,); NaN without a gripper."""
    row[0] = opening[0] if len(opening) else np.nan
    row[1] = -force[0] if len(force) else np.nan
