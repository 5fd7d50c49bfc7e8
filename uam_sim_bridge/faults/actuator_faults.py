"""Faults of motors, battery, servos, magnet and payload; and wind gusts."""

import math
from typing import ClassVar

import numpy as np

from uam_control.settings.parameter_set import integer, number
from uam_sim_bridge.faults.fault import Occurrence, PlantCommands, PlantFault
from uam_sim_bridge.plant import Disturbance

JOINT = "joint number"


class PhysicsFault(PlantFault):
    """A fault that changes the physics."""

    PHYSICS: ClassVar[bool] = True


class ServoWeak(PlantFault):
    """A servo gives only a fraction of the commanded torque."""

    joint: int = integer(1, JOINT, 1, 7)
    remaining: float = number(0.0, "fraction of the torque that remains", "1", 0.0, 1.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        commands.effort[self.joint - 1] *= self.remaining


class ServoJam(PhysicsFault):
    """A joint's gear jams and holds its present angle."""

    joint: int = integer(1, JOINT, 1, 7)
    torque: float = number(20.0, "torque that still moves the joint", "N m", 0.1, 1000.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        physics.joint_friction[self.joint - 1] += self.torque


class MagnetWeak(PhysicsFault):
    """The magnet holds with a fraction of its force, or with none."""

    remaining: float = number(0.0, "fraction of the force that remains", "1", 0.0, 1.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        physics.magnet_part *= self.remaining


class MagnetStuck(PlantFault):
    """The magnet does not release the payload when it is switched off."""

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        now.memory = commands.magnet = commands.magnet or bool(now.memory)


class PayloadSwing(PhysicsFault):
    """The payload hangs from one point of the magnet and swings freely."""

    rate: float = number(5.0, "initial pitch rate of the payload", "rad/s", -20.0, 20.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        physics.payload_swing = self.rate


class MotorLoss(PhysicsFault):
    """A motor gives only a fraction of its thrust, as with a broken propeller."""

    motor: int = integer(1, "motor number, in PX4's order", 1, 12)
    remaining: float = number(0.5, "fraction of the thrust that remains", "1", 0.0, 1.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        physics.rotor_parts[self.motor - 1] *= self.remaining


class BatterySag(PhysicsFault):
    """The battery voltage falls, and with it the thrust of all motors."""

    remaining: float = number(0.8, "fraction of the thrust that remains", "1", 0.1, 1.0)
    over: float = number(2.0, "time in which the thrust falls", "s", 0.0, 1000.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        physics.rotor_parts *= 1.0 + now.done(self.over) * (self.remaining - 1.0)


class WindGust(PhysicsFault):
    """Additional wind that rises smoothly."""

    speed: float = number(4.0, "horizontal speed", "m/s", 0.0, 40.0)
    towards: float = number(
        0.0, "direction of the flow, 0 along x, 90 along y", "deg", -360.0, 360.0
    )
    up: float = number(0.0, "vertical speed", "m/s", -20.0, 20.0)
    rise: float = number(0.5, "rise time", "s", 0.0, 100.0)

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        angle = math.radians(self.towards)
        full = np.array([self.speed * math.cos(angle), self.speed * math.sin(angle), self.up])
        physics.wind += 0.5 * (1.0 - math.cos(math.pi * now.done(self.rise))) * full
