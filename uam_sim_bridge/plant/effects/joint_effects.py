"""Effects of the servos and the arm: noise of the torque, gears, readings, cables.

Noise. White noise through a first-order low-pass, exact for any step: its standard deviation does
not depend on the step.

Gear. Friction of the motor's side, semi-implicit: a motor that it can stop stands still. With a
width friction is smooth in the speed instead, and never takes more than the momentum of a step:

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

Cables. Those that cross a joint are a spring towards the pose in which they were laid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.settings.parameter_set import ParameterError
from uam_sim_bridge.plant.effects.effect import Acting, Bench, Compiled, Effect, each, size
from uam_sim_bridge.plant.sensors import Noise, next_row


class ServoNoise(Effect):
    """The torque of the servos has noise of their current loops."""

    SOURCE = (
        "XM430-W350 on a bench, FSC-Lab [srv]: 6 to 10 mA rms, 15 to 24 mN m, 5 Hz; laboratory: "
        "its 10 mA at the torque per current of the XM430-W210, 1.3 N m/A"
    )

    torque: tuple[float, ...] = each(
        "standard deviation, for each joint or for all", "N m", 0.0, 0.5
    )
    bandwidth: float = size("of the noise", "Hz", 0.1, 100.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        count, keep = bench.joints, math.exp(-2.0 * math.pi * self.bandwidth * bench.period)
        sizes = bench.for_each("servo_noise: torque", self.torque, count, "joints")
        white = Noise(noise, math.sqrt(1.0 - keep * keep) * sizes)
        arrays = bench.body.torque_control, white.arrays, np.zeros(count), keep
        return Compiled(arrays, [white], tick=renew, joints=add)


@borrowing
def renew(a: tuple) -> int:
    """Advance the present noise (n,) by a tick: `keep` of it, and a row of white noise [N m]."""
    _, white, noise, keep = a
    drawn = white.rows[next_row(white)]
    for i in range(len(noise)):
        noise[i] = keep * noise[i] + drawn[i]
    return 0


@borrowing
def add(a: tuple) -> int:
    """Add the noise to the torques (n,) [N m] on the joints; see `renew`."""
    torque, _, noise, _ = a
    for i in range(len(noise)):
        torque[i] += noise[i]
    return 0


STABLE = 3.0  # of 4, at which steps become unstable
LINK_ARMATURE = 5e-4  # [kg m^2] left on the link: output shaft and horn


class JointGear(Effect):
    """The joints' gears have friction by load, more of it at rest, backlash and elastic teeth."""

    SOURCE = (
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
        model, dofs, count = bench.model, bench.arm, bench.joints
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
            bench.body.alpha.copy(),
            np.zeros(count),
        )
        arrays = motors, bench.body.alpha, bench.data.qvel[dofs], bench.body.torque_control
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
    link = np.diag(np.linalg.inv(mass))[bench.arm]  # 1 / J of each, the others free
    step = model.opt.timestep
    needed = (stiffness * step**2 + 2.0 * damping * step) * (1.0 / motor + link)
    return np.minimum(1.0, STABLE / np.maximum(needed, 1e-9))


class Gear(NamedTuple):
    """The motors behind the gears of n joints. constants: half backlash [rad], stiffness [N m/rad],
    damping [N m s/rad], stiction [1], Stribeck speed [rad/s], width [rad/s], step [s]."""

    inertia: np.ndarray  # (n,) [kg m^2]
    coulomb: np.ndarray  # (n,) [N m]
    load: np.ndarray  # (n,) [1]
    constants: np.ndarray  # (7,)
    teeth: np.ndarray  # (n,) part of stiffness and damping, see `followed`
    angle: np.ndarray  # (n,) [rad] state
    speed: np.ndarray  # (n,) [rad/s] state


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


class JointReadings(Effect):
    """The servos report their speed late, and angle and speed in coarse units."""

    SOURCE = (
        "XM430-W350 of FSC-Lab: present velocity 44 to 56 ms late [wb 2.7, arm]; units: ROBOTIS "
        "e-manual"
    )

    delay: float = size("of the speed", "s", 0.0, 0.2)
    speed_unit: float = size("quantum of the speed", "rad/s", 1e-4, 0.5)
    counts: float = size("counts of the encoder per turn", "1", 64.0, 1048576.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        n, ticks = bench.joints, round(self.delay / bench.period)
        bench.body.encoder_units[:] = 2.0 * np.pi / self.counts, self.speed_unit
        speeds = bench.sample[6 + n : 6 + 2 * n]
        arrays = speeds, np.zeros((ticks + 1, n)), np.zeros(1, dtype=np.int64)
        return Compiled(arrays, sample=hold_back)


@borrowing
def hold_back(a: tuple) -> int:
    """Exchange the speeds (n,) of a tick for those that are reported at it.

    earlier (ticks + 1, n): of the last ticks, in a ring; place (1,): its row.
    """
    speeds, earlier, place = a
    row = place[0]
    following = (row + 1) % len(earlier)
    for i in range(len(speeds)):
        earlier[row, i] = speeds[i]
        speeds[i] = earlier[following, i]
    place[0] = following
    return 0


class CableTorque(Effect):
    """The cables along the arm pull each joint towards its stowed angle."""

    SOURCE = (
        "assumption: one servo cable and the magnet's two wires in a loop of some 5 cm; "
        "0.02 N m/rad is 1 % of the servo's stall torque at 90 deg"
    )

    stiffness: float = size("torque per angle", "N m/rad", 0.0, 0.5)
    stiffness_spread: float = size("standard deviation / stiffness, per flight", "1", 0.0, 1.0)
    rest_spread_deg: float = size("standard deviation of the rest angle, per flight", "deg", 0, 45)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        joints = bench.joints
        drawn = noise.standard_normal((2, joints))
        stiffness = self.stiffness * np.abs(1.0 + self.stiffness_spread * drawn[0])
        rest = bench.vehicle.description.stowed + np.radians(self.rest_spread_deg) * drawn[1]
        torque = bench.data.qfrc_applied[bench.arm]
        return Compiled((torque, bench.body.alpha, stiffness, rest), tick=pull)


@borrowing
def pull(a: tuple) -> int:
    """Set the torques (n,) [N m] of springs: their angles, stiffnesses and rest angles (n,)."""
    torque, angles, stiffness, rest = a
    for i in range(len(torque)):
        torque[i] = stiffness[i] * (rest[i] - angles[i])
    return 0
