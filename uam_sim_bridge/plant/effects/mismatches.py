"""A vehicle, and a motion capture, that are not what the vehicle file says."""

from typing import ClassVar

import numpy as np

from uam_control.vehicle.plant_numbers import LARGEST_RATE, LEAST_RATE
from uam_sim_bridge.plant.effects.effect import Bench, Effect, each, several, size
from uam_sim_bridge.plant.vehicle import vary

LIMIT = 2.5  # [1] a draw is at most so many standard deviations away: worse parts are exchanged


class RotorMismatch(Effect):
    """Thrust, reaction torque, lags and idle speed of the rotors are not the vehicle file's."""

    SOURCE: ClassVar[str] = (
        "six flights and a thrust stand of the T650, FSC-Lab: thrust 0.946 to 1.011 of what its "
        "allocator believes, reaction torque / thrust 0.76 of it [fit, wb 1.1-1.6]"
    )

    thrust: tuple[float, ...] = each(
        "thrust / the vehicle file's, for each rotor or for all", "1", 0.5, 1.5
    )
    yaw: float = size("reaction torque per thrust / the vehicle file's", "1", 0.0, 3.0)
    lag_up: float = size("time constant while speeding up / the vehicle file's", "1", 0.1, 10.0)
    lag_down: float = size("the same while slowing down", "1", 0.1, 10.0)
    idle: float = size(
        "speed at command 0 / full speed, linear between; 0: the vehicle file's curve",
        "1",
        0.0,
        0.5,
    )

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        rotors, count = bench.rotors, len(bench.rotors.speed)
        rotors.efficiency *= bench.for_each("rotor_mismatch: thrust", self.thrust, count, "rotors")
        rotors.scale_lags(np.array([[self.lag_up], [self.lag_down]]))
        if self.idle > 0.0:
            rotors.turn_linearly(self.idle)
        for name in bench.vehicle.description.rotor_names:
            bench.model.actuator(name).gear[5] *= self.yaw


class RotorSpread(Effect):
    """Rotors differ in thrust at the same command, motors and ESCs in their time constants."""

    SOURCE: ClassVar[str] = (
        "thrust: 10-inch propellers and 5010 motors of one batch on a thrust stand differ by some "
        "per cent (assumption, 3 %); lag: assumption, 10 %"
    )

    thrust: float = size("standard deviation of the thrust factor", "1", 0.0, 0.2)
    lag: float = size("standard deviation of the factor on the time constants", "1", 0.0, 0.3)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        rotors = bench.rotors
        drawn = np.clip(noise.standard_normal((2, len(rotors.speed))), -LIMIT, LIMIT)
        rotors.efficiency *= 1.0 + self.thrust * drawn[0]
        rotors.scale_lags(1.0 + self.lag * drawn[1])


class MassMismatch(Effect):
    """Masses, inertias and centre of mass of base and arm are not the vehicle file's."""

    SOURCE: ClassVar[str] = (
        "stress plant of the T650, FSC-Lab, its config A: base and inertia 1.1, arm 1.05, "
        "10, 10 and 5 mm; laboratory: half of them, an assumption: scales weigh to 1 %"
    )

    base: float = size("mass of the base / the vehicle file's", "1", 0.5, 2.0)
    inertia: float = size("inertia of the base / the vehicle file's", "1", 0.3, 3.0)
    arm: float = size("mass and inertia of the arm / the vehicle file's", "1", 0.5, 2.0)
    shift: tuple[float, ...] = several("of the base's centre of mass: x, y, z", "m", -0.1, 0.1)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        vary(bench.model, (self.base, self.arm), (self.inertia / self.base, 1.0), self.shift)


class MocapFeed(Effect):
    """Rate, noise and delay of the motion capture are not the vehicle file's.

    Above the rate of the ticks several poses are taken in a tick, each of its own time.
    """

    SOURCE: ClassVar[str] = (
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
