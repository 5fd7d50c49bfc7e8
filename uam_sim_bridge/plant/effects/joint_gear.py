"""Gear of the joint servos: backlash, tooth stiffness, stiction.

Motor and link are two masses. The motor has the reflected inertia and the friction that the calm
plant gives to the joint. Between them is a dead zone of the backlash; beyond it the teeth are a
spring with damping:

    J_m theta_m'' = tau_servo - tau_gear - friction
    tau_gear = k dead_zone(theta_m - alpha) + c (theta_m' - alpha'), without pull of the teeth
    friction <= F_c + (F_s - F_c) exp(-(theta_m' / v_s)^2)    (Stribeck), at rest up to F_s

The friction is semi-implicit: a motor that it can stop stands still. The servo's encoder is on the
output shaft, so that it measures the link.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from uam_control.maths.compiled import jit
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Effect, size

LINK_ARMATURE = 5e-4  # [kg m^2] left on the link: output shaft and horn


class JointGear(Effect):
    """The joints' gears have backlash, elastic teeth and more friction at rest than in motion."""

    SOURCE: ClassVar[str] = (
        "backlash: ROBOTIS e-manual, X series, 15 arcmin; Stribeck friction of such servos: "
        "Duclusaud et al. 2024, arXiv 2410.08650; friction at rest / in motion, stiffness: "
        "assumptions"
    )

    backlash_deg: float = size("whole play at the output", "deg", 0.0, 5.0)
    stiffness: float = size("of the teeth", "N m/rad", 10.0, 300.0)
    damping: float = size("of the teeth", "N m s/rad", 0.0, 1.0)
    stiction: float = size("friction at rest / friction in motion", "1", 1.0, 5.0)
    stribeck_speed: float = size("speed at which the excess has fallen to 1/e", "rad/s", 0.001, 1.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        return _Gear(self, bench)


class _Gear(Acting):
    def __init__(self, p: JointGear, bench: Bench) -> None:
        model, data, dofs = bench.model, bench.data, bench.arm_dofs
        self._bench, first = bench, bench.model.dof_jntid[dofs.start]
        start = model.jnt_qposadr[first]
        self._alpha = data.qpos[start : start + bench.arm[1]]
        self._alpha_dot = data.qvel[dofs]
        constants = np.array(
            [
                0.5 * math.radians(p.backlash_deg),
                p.stiffness,
                p.damping,
                p.stiction,
                p.stribeck_speed,
                model.opt.timestep,
            ]
        )
        own = model.dof_armature[dofs].copy(), model.dof_frictionloss[dofs].copy()
        model.dof_armature[dofs] = LINK_ARMATURE
        model.dof_frictionloss[dofs] = 0.0
        self.motors = Gear(*own, constants, self._alpha.copy(), np.zeros(bench.arm[1]))

    def joints(self) -> None:
        bench = self._bench
        gear_step(
            self.motors, bench.servo_torque, self._alpha, self._alpha_dot, bench.torque_control
        )


class Gear(NamedTuple):
    """The motors behind the gears of n joints.

    inertia (n,) [kg m^2], friction (n,) [N m]; constants (6,): half backlash [rad], stiffness
    [N m/rad], damping [N m s/rad], stiction [1], Stribeck speed [rad/s], step [s]; their state:
    angle (n,) [rad], speed (n,) [rad/s].
    """

    inertia: np.ndarray
    friction: np.ndarray
    constants: np.ndarray
    angle: np.ndarray
    speed: np.ndarray


@jit
def gear_step(
    gear: Gear, torque: np.ndarray, alpha: np.ndarray, alpha_dot: np.ndarray, output: np.ndarray
) -> None:
    """Advance the motors by one physics step; write the torque on the links to output (n,) [N m].

    torque (n,) [N m] of the servos; alpha, alpha_dot (n,) of the links.
    """
    inertia, friction, constants, angle, speed = gear
    half, stiffness, damping, stiction, slow, step = constants
    for i in range(len(torque)):
        gap = angle[i] - alpha[i]
        contact = 0.0
        if gap > half:
            contact = stiffness * (gap - half) + damping * (speed[i] - alpha_dot[i])
            contact = max(contact, 0.0)  # teeth do not pull
        elif gap < -half:
            contact = stiffness * (gap + half) + damping * (speed[i] - alpha_dot[i])
            contact = min(contact, 0.0)
        ratio = speed[i] / slow
        limit = friction[i] * (1.0 + (stiction - 1.0) * math.exp(-ratio * ratio))
        free = speed[i] + step / inertia[i] * (torque[i] - contact)
        brake = step / inertia[i] * limit
        if abs(free) <= brake:
            speed[i] = 0.0
        else:
            speed[i] = free - math.copysign(brake, free)
        angle[i] += step * speed[i]
        output[i] = contact
