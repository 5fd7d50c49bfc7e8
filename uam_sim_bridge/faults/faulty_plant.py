"""The plant with fault injection: changes samples, commands and model at each tick.

Flights without plant faults use `Plant` itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from uam_sim_bridge.faults.fault import Effect, PlantCommands
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.plant import Plant, Samples, Vehicle
from uam_sim_bridge.plant.payload_hinge import PayloadHinge, add_to
from uam_sim_bridge.plant.vehicle import MAGNET

STIFF = 0.9999  # constraint impedance of a friction without creep, see MuJoCo's solimp


class FaultyPlant(Plant):
    """A Plant with faults that begin and end at mission times; `mission_at` sets the time."""

    def __init__(
        self,
        vehicle: Vehicle,
        payload_mass: float,
        seed: int,
        arm_start: Sequence[float],
        schedule: Schedule,
    ) -> None:
        """See `Plant`; schedule: faults of the plant only."""
        super().__init__(vehicle, payload_mass, seed, arm_start)
        self.timeline = Timeline(schedule)
        self.changed: list[FaultState] = []  # faults that began or ended at this tick
        self._effects: dict[int, Effect] = {}
        self._touched = False
        streams = np.random.SeedSequence(schedule.seed, spawn_key=(0xFA,)).spawn(
            len(schedule.faults)
        )
        self._noise = [np.random.default_rng(stream) for stream in streams]
        model = self.model
        self._arm_dofs = [model.joint(name).dofadr[0] for name in vehicle.description.joint_names]
        self._magnet_id = model.actuator(MAGNET).id
        self._usual = (
            self.rotors.efficiency.copy(),
            model.dof_frictionloss[self._arm_dofs].copy(),
            model.dof_solimp[self._arm_dofs].copy(),
            self._magnet_gain,
        )
        self._added_wind, self._fault_wind = np.zeros(3), np.zeros(3)
        self._hinge = PayloadHinge(model, self.data)
        self._swinging = False

    def _compile(self, vehicle: Vehicle, payload_mass: float) -> mujoco.MjModel:
        return vehicle.compile(payload_mass, add_to)

    def mission_at(self, stamp: float, time: float) -> None:
        """See `Timeline.mission_at`."""
        self.timeline.mission_at(stamp, time)

    def sense(self) -> Samples:
        """Return the samples of `Plant.sense`, changed by the active faults."""
        self.changed = self.timeline.update(self.time)
        for one in self.changed:
            if one.active:
                self._effects[one.number] = one.fault.effect(self._noise[one.number])
            else:
                del self._effects[one.number]
        samples = super().sense()
        for effect in self._effects.values():
            effect.sense(samples)
        return samples

    def step(self, motor_commands: np.ndarray, arm_effort: np.ndarray, magnet: bool) -> None:
        """Step as in `Plant.step`, with commands and model changed by the active faults.

        motor_commands (n_rotors,) 0..1; arm_effort (n_joints,) [N m].
        """
        if self._effects or self._touched:
            commands = PlantCommands(np.array(motor_commands), np.array(arm_effort), bool(magnet))
            self._as_usual()
            for effect in self._effects.values():
                effect.act(self, commands)
            self._settle()
            motor_commands, arm_effort = commands.motors, commands.effort
            magnet = commands.magnet
            self._touched = bool(self._effects)
        super().step(motor_commands, arm_effort, magnet)

    def weaken_rotor(self, rotor: int, part: float) -> None:
        """Scale the thrust of one rotor (0: the first) by `part` [1] for this period."""
        self.rotors.efficiency[rotor] *= part

    def weaken_rotors(self, part: float) -> None:
        """Scale the thrust of all rotors by `part` [1] for this period."""
        self.rotors.efficiency *= part

    def brake_joint(self, joint: int, torque: float) -> None:
        """Add dry friction `torque` [N m] to a joint (0: the first) for this period."""
        self.model.dof_frictionloss[self._arm_dofs[joint]] += torque
        self.model.dof_solimp[self._arm_dofs[joint], 0:2] = STIFF

    def weaken_magnet(self, part: float) -> None:
        """Scale the magnet's holding force by `part` [1] for this period."""
        self._magnet_gain *= part

    def add_wind(self, wind: np.ndarray) -> None:
        """Add wind (3,) [m/s, ENU] for this period."""
        self._fault_wind += wind

    def swing_payload(self, commands: PlantCommands, rate: float) -> None:
        """Attach the payload by a hinge while the magnet is on; rate [rad/s]: initial rate."""
        self._swinging = commands.magnet and (self._hinge.closed or self._hinge.close(rate))
        if self._swinging:
            commands.magnet = False  # the hinge replaces the magnet's rigid contact

    def _as_usual(self) -> None:
        """Undo the changes of the last period."""
        efficiency, friction, softness, gain = self._usual
        self.rotors.efficiency[:] = efficiency
        self.model.dof_frictionloss[self._arm_dofs] = friction
        self.model.dof_solimp[self._arm_dofs] = softness
        self._magnet_gain = gain
        self._fault_wind[:] = 0.0
        self._swinging = False

    def _settle(self) -> None:
        """Write the magnet's gain, the wind and the hinge's state to the model."""
        self.model.actuator_gainprm[self._magnet_id, 0] = self._magnet_gain
        change = self._fault_wind - self._added_wind
        self.wind += change
        self._wind_mean += change
        self._added_wind += change
        if not self._swinging and self._hinge.closed:
            self._hinge.open()
