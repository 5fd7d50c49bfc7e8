"""Gear of the joint servos: friction, backlash, tooth stiffness.

Friction of the motor's side, semi-implicit: a motor that it can stop stands still. With a width
friction is smooth in the speed instead, and never takes more than the momentum of a step:

    |friction| <= (F_c + mu |tau_servo|) (1 + (s - 1) exp(-(theta_m' / v_s)^2))      (Stribeck)
    friction = that limit x tanh(theta_m' / w)                                       with a width w

Motor and link are two masses. The motor has the reflected inertia and the friction that the calm
plant gives to the joint. Between them is a dead zone of the backlash; beyond it the teeth are a
spring with damping:

    J_m theta_m'' = tau_servo - tau_gear - friction
    tau_gear = k dead_zone(theta_m - alpha) + c (theta_m' - alpha'), without pull of the teeth

The teeth of a joint are softer where its motor and link are too light for the physics step.

Without stiffness the gear is rigid: motor and link are one mass. The servo's encoder is on the
output shaft, so that it measures the link.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import mujoco
import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.settings.parameter_set import ParameterError
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, each, size

STABLE = 3.0  # of 4, at which steps become unstable
LINK_ARMATURE = 5e-4  # [kg m^2] left on the link: output shaft and horn


class JointGear(Effect):
    """The joints' gears have friction by load, more of it at rest, backlash and elastic teeth."""

    SOURCE: ClassVar[str] = (
        "backlash: ROBOTIS e-manual, X series, 15 arcmin; Stribeck friction of such servos: "
        "Duclusaud et al. 2024, arXiv 2410.08650; load: XM430-W350 on a bench, FSC-Lab [srv], the "
        "mean of its two loaded joints, 0.246 and 0.161; friction at rest / in motion, stiffness: "
        "assumptions"
    )

    backlash_deg: float = size("whole play at the output", "deg", 0.0, 5.0)
    stiffness: float = size("of the teeth, 0: rigid, without play", "N m/rad", 0.0, 300.0)
    damping: float = size("of the teeth", "N m s/rad", 0.0, 1.0)
    coulomb: tuple[float, ...] = each(
        "F_c, for each joint or for all; []: the vehicle file's", "N m", 0.0, 1.0, optional=True
    )
    load: tuple[float, ...] = each(
        "mu, friction / torque, for each joint or for all", "1", 0.0, 0.9
    )
    stiction: float = size("s, friction at rest / friction in motion", "1", 1.0, 5.0)
    stribeck_speed: float = size("speed at which the excess has fallen to 1/e", "rad/s", 0.001, 1.0)
    width: float = size("w, speed of smooth friction, 0: dry; a rigid gear has one", "rad/s", 0, 1)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        model, dofs, count = bench.model, bench.arm_dofs, bench.arm[1]
        coulomb = model.dof_frictionloss[dofs].copy()
        if self.coulomb:
            coulomb = bench.for_each("joint_gear: coulomb", self.coulomb, count, "joints")
        constants = (
            *(0.5 * math.radians(self.backlash_deg), self.stiffness, self.damping, self.stiction),
            *(self.stribeck_speed, self.width, model.opt.timestep),
        )
        inertia = model.dof_armature[dofs].copy()
        model.dof_frictionloss[dofs] = 0.0
        if self.stiffness:
            model.dof_armature[dofs] = LINK_ARMATURE
        motors = Gear(
            inertia,
            coulomb,
            bench.for_each("joint_gear: load", self.load, count, "joints"),
            np.array(constants),
            followed(bench, inertia, self.stiffness, self.damping),
            bench.angles.copy(),
            np.zeros(count),
        )
        arrays = motors, bench.angles, bench.data.qvel[dofs], bench.torque_control
        return Compiled(arrays, joints=act)

    def check_together(self) -> None:
        if self.stiffness == self.width == 0.0:
            raise ParameterError("width: 0.0 with stiffness 0; a rigid gear has a width above 0")


def followed(bench: Bench, motor: np.ndarray, stiffness: float, damping: float) -> np.ndarray:
    """Return the part (n,) of the teeth's stiffness and damping that the physics step can follow.

    motor (n,) [kg m^2]: inertia of the motors. Motor and link, J together, are stable in steps of h
    where k h^2 + 2 c h < 4 J; small servos with light links are not with the teeth of large ones.
    """
    model, data = bench.model, mujoco.MjData(bench.model)
    data.qpos[:] = bench.data.qpos
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    link = np.diag(np.linalg.inv(mass))[bench.arm_dofs]  # 1 / J of each, the others free
    step = model.opt.timestep
    needed = (stiffness * step**2 + 2.0 * damping * step) * (1.0 / motor + link)
    return np.minimum(1.0, STABLE / np.maximum(needed, 1e-9))


class Gear(NamedTuple):
    """The motors behind the gears of n joints.

    inertia (n,) [kg m^2], coulomb (n,) [N m], load (n,) [1]; constants (7,): half backlash [rad],
    stiffness [N m/rad], damping [N m s/rad], stiction [1], Stribeck speed [rad/s], width [rad/s],
    step [s]; teeth (n,): part of stiffness and damping, see `followed`; their state: angle (n,)
    [rad], speed (n,) [rad/s].
    """

    inertia: np.ndarray
    coulomb: np.ndarray
    load: np.ndarray
    constants: np.ndarray
    teeth: np.ndarray
    angle: np.ndarray
    speed: np.ndarray


@borrowing
def act(a: tuple) -> int:
    """Replace the torques of the servos by those on the links; see `gear_step`, `rigid_step`."""
    gear, alpha, alpha_dot, torque = a
    if gear.constants[1] == 0.0:
        rigid_step(gear, torque, alpha_dot)
    else:
        gear_step(gear, torque, alpha, alpha_dot, torque)
    return 0


@borrowing
def braked(gear: Gear, i: int, torque: float, speed: float, free: float) -> float:
    """Return the change of the momentum by friction in a step [N m s], at the speed [rad/s].

    torque [N m]: of the servo; free [N m s]: momentum that the motor has without friction.
    """
    _, _, _, stiction, slow, width, step = gear.constants
    ratio = speed / slow
    limit = (gear.coulomb[i] + gear.load[i] * abs(torque)) * step
    limit *= 1.0 + (stiction - 1.0) * math.exp(-ratio * ratio)
    if width > 0.0:
        loss, most = limit * math.tanh(speed / width), gear.inertia[i] * abs(speed)
        return -min(most, max(-most, loss))
    return -math.copysign(min(limit, abs(free)), free)


@borrowing
def rigid_step(gear: Gear, torque: np.ndarray, speed: np.ndarray) -> None:
    """Take the friction of a physics step from torque (n,) [N m]; speed (n,) [rad/s]."""
    for i in range(len(torque)):
        torque[i] += braked(gear, i, torque[i], speed[i], 0.0) / gear.constants[6]


@borrowing
def gear_step(
    gear: Gear, torque: np.ndarray, alpha: np.ndarray, alpha_dot: np.ndarray, output: np.ndarray
) -> None:
    """Advance the motors by one physics step; write the torque on the links to output (n,) [N m].

    torque (n,) [N m] of the servos, may be the same array; alpha, alpha_dot (n,) of the links.
    """
    angle, speed = gear.angle, gear.speed
    half, stiffness, damping, _, _, _, step = gear.constants
    for i in range(len(torque)):
        gap = angle[i] - alpha[i]
        contact = 0.0
        if gap > half:
            contact = stiffness * (gap - half) + damping * (speed[i] - alpha_dot[i])
            contact = gear.teeth[i] * max(contact, 0.0)  # teeth do not pull
        elif gap < -half:
            contact = stiffness * (gap + half) + damping * (speed[i] - alpha_dot[i])
            contact = gear.teeth[i] * min(contact, 0.0)
        free = gear.inertia[i] * speed[i] + step * (torque[i] - contact)
        speed[i] = (free + braked(gear, i, torque[i], speed[i], free)) / gear.inertia[i]
        angle[i] += step * speed[i]
        output[i] = contact
