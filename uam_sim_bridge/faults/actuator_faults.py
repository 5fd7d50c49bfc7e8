"""Faults of motors, battery, servos, magnet and payload; and wind gusts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uam_control.settings.parameter_set import number
from uam_sim_bridge.faults.fault import Disturbable, Effect, PlantCommands, PlantFault

JOINT = "joint number"


class ActEffect(Effect):
    """Calls `action(plant, commands)` at each tick."""

    def __init__(self, action: Callable[[Disturbable, PlantCommands], None]):
        self._action = action

    def act(self, plant: Disturbable, commands: PlantCommands) -> None:
        self._action(plant, commands)


@dataclass(frozen=True)
class MotorLoss(PlantFault):
    NAME: ClassVar[str] = "motor_loss"
    ABOUT: ClassVar[str] = "a motor gives only a fraction of its thrust, as with a broken propeller"
    PHYSICS: ClassVar[bool] = True

    motor: float = number(1, "motor number, in PX4's order", "1", 1, 12)
    remaining: float = number(0.5, "fraction of the thrust that remains", "1", 0.0, 1.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return ActEffect(lambda plant, _: plant.weaken_rotor(int(self.motor) - 1, self.remaining))


@dataclass(frozen=True)
class BatterySag(PlantFault):
    NAME: ClassVar[str] = "battery_sag"
    ABOUT: ClassVar[str] = "the battery voltage falls, and with it the thrust of all motors"
    PHYSICS: ClassVar[bool] = True

    remaining: float = number(0.8, "fraction of the thrust that remains", "1", 0.1, 1.0)
    over: float = number(2.0, "time in which the thrust falls", "s", 0.0, 1000.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return Sag(self.remaining, self.over)


class Sag(Effect):
    """Linear decrease of the thrust."""

    def __init__(self, remaining: float, over: float):
        self._remaining, self._over = remaining, over
        self._since = 0.0

    def act(self, plant: Disturbable, commands: PlantCommands) -> None:
        done = 1.0 if self._since >= self._over else self._since / self._over
        plant.weaken_rotors(1.0 + done * (self._remaining - 1.0))
        self._since += plant.period


@dataclass(frozen=True)
class ServoWeak(PlantFault):
    NAME: ClassVar[str] = "servo_weak"
    ABOUT: ClassVar[str] = "a servo gives only a fraction of the commanded torque"

    joint: float = number(1, JOINT, "1", 1, 7)
    remaining: float = number(0.0, "fraction of the torque that remains", "1", 0.0, 1.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        def weaken(plant: Disturbable, commands: PlantCommands) -> None:
            commands.effort[int(self.joint) - 1] *= self.remaining

        return ActEffect(weaken)


@dataclass(frozen=True)
class ServoJam(PlantFault):
    NAME: ClassVar[str] = "servo_jam"
    ABOUT: ClassVar[str] = "a joint's gear jams and holds its present angle"
    PHYSICS: ClassVar[bool] = True

    joint: float = number(1, JOINT, "1", 1, 7)
    torque: float = number(20.0, "torque that still moves the joint", "N m", 0.1, 1000.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return ActEffect(lambda plant, _: plant.brake_joint(int(self.joint) - 1, self.torque))


@dataclass(frozen=True)
class MagnetWeak(PlantFault):
    NAME: ClassVar[str] = "magnet_weak"
    ABOUT: ClassVar[str] = "the magnet holds with a fraction of its force, or with none"
    PHYSICS: ClassVar[bool] = True

    remaining: float = number(0.0, "fraction of the force that remains", "1", 0.0, 1.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return ActEffect(lambda plant, _: plant.weaken_magnet(self.remaining))


@dataclass(frozen=True)
class MagnetStuck(PlantFault):
    NAME: ClassVar[str] = "magnet_stuck"
    ABOUT: ClassVar[str] = "the magnet does not release the payload when it is switched off"

    def effect(self, noise: np.random.Generator) -> Effect:
        return Remanent()


class Remanent(Effect):
    """Keeps the magnet on after it was switched on once."""

    def __init__(self):
        self._on = False

    def act(self, plant: Disturbable, commands: PlantCommands) -> None:
        self._on = commands.magnet = commands.magnet or self._on


@dataclass(frozen=True)
class PayloadSwing(PlantFault):
    NAME: ClassVar[str] = "payload_swing"
    ABOUT: ClassVar[str] = "the payload hangs from one point of the magnet and swings freely"
    PHYSICS: ClassVar[bool] = True

    rate: float = number(5.0, "initial pitch rate of the payload", "rad/s", -20.0, 20.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        return ActEffect(lambda plant, _: plant.swing_payload(self.rate))


@dataclass(frozen=True)
class WindGust(PlantFault):
    NAME: ClassVar[str] = "wind_gust"
    ABOUT: ClassVar[str] = "additional wind that rises smoothly"
    PHYSICS: ClassVar[bool] = True

    speed: float = number(4.0, "horizontal speed", "m/s", 0.0, 40.0)
    towards: float = number(
        0.0, "direction of the flow, 0 along x, 90 along y", "deg", -360.0, 360.0
    )
    up: float = number(0.0, "vertical speed", "m/s", -20.0, 20.0)
    rise: float = number(0.5, "rise time", "s", 0.0, 100.0)

    def effect(self, noise: np.random.Generator) -> Effect:
        angle = math.radians(self.towards)
        full = [self.speed * math.cos(angle), self.speed * math.sin(angle), self.up]
        return Gust(np.array(full), self.rise)


class Gust(Effect):
    """Adds wind `full` (3,) [m/s, ENU] that rises in `rise` [s] as half a cosine."""

    def __init__(self, full: np.ndarray, rise: float):
        self._full, self._rise = full, rise
        self._since = 0.0

    def act(self, plant: Disturbable, commands: PlantCommands) -> None:
        risen = 1.0 if self._since >= self._rise else self._since / self._rise
        plant.add_wind(0.5 * (1.0 - math.cos(math.pi * risen)) * self._full)
        self._since += plant.period


FAULTS = (
    ServoWeak,
    ServoJam,
    MagnetWeak,
    MagnetStuck,
    PayloadSwing,
    MotorLoss,
    BatterySag,
    WindGust,
)
