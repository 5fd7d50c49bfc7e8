"""A plant with fault injection: changes samples, commands and physics at each tick.

The plant works with that of any physics engine. Flights without plant faults use that one itself.
The link of the direct engine skips the messages that a fault loses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.stages.step import DONE, Step
from uam_sim_bridge.faults.fault import (
    LINK,
    PLANT,
    FaultError,
    Occurrence,
    PlantCommands,
    PlantFault,
)
from uam_sim_bridge.faults.link_faults import MavlinkCut
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.plant import Disturbance, Plant, Samples, Truth, Vehicle
from uam_sim_bridge.plant.plant import DEFAULT_PLANT, PlantError, plant_class


def make_plant(
    vehicle: Vehicle,
    payload_mass: float,
    seed: int,
    arm_start: Sequence[float],
    faults: Schedule,
    engine: str = DEFAULT_PLANT,
) -> Plant:
    """Return the plant of a flight, with the plant faults of `faults` if there are any.

    engine: see `plant_class`; the others as of `MujocoPlant`. Raises PlantError, FaultError.
    """
    check_engine(faults, engine, vehicle.numbers["effects"])
    acting = faults.only(PLANT)
    plant = plant_class(engine)(vehicle, payload_mass, seed, arm_start, bool(_physical(acting)))
    return FaultyPlant(plant, acting) if acting else plant


def check_engine(faults: Schedule, engine: str, effects: object = None) -> None:
    """Raise PlantError for an unknown engine, or one without the effects of the flight.

    Raises FaultError for faults that it cannot simulate.
    """
    if effects and not plant_class(engine).HAS_EFFECTS:
        raise PlantError(f"plant {engine} has no effects: it flies with the preset calm only")
    physical = _physical(faults)
    if not plant_class(engine).DISTURBABLE and physical:
        raise FaultError(
            f"fault {physical[0]}: plant {engine} has no faults of the physics, only those of "
            "sensors and commands"
        )


def _physical(faults: Schedule) -> list[str]:
    """Names of the faults that change the physics."""
    return [one.fault.NAME for one in faults.faults if getattr(one.fault, "PHYSICS", False)]


class FaultyPlant(Plant):
    """A plant with faults that begin and end at the mission times of `timeline`.

    `physics`: the plant that it changes. `senses`, `acts`: whether it changes samples, and
    commands or physics, until the next fault begins or ends.
    """

    def __init__(self, physics: Plant, schedule: Schedule) -> None:
        """schedule: faults of the plant only."""
        self._physics = physics
        super().__init__(physics.vehicle)
        self.senses = self.acts = False
        self.timeline = Timeline(schedule)
        self.changed: list[FaultState] = []  # faults that began or ended at this tick
        self._active: dict[int, tuple[PlantFault, Occurrence]] = {}
        streams = np.random.SeedSequence(schedule.seed, spawn_key=(0xFA,)).spawn(
            len(schedule.faults)
        )
        self._noise = [np.random.default_rng(stream) for stream in streams]

    @property
    def physics(self) -> Plant:
        """See `Plant.physics`."""
        return self._physics

    @property
    def tick(self) -> int:
        return self._physics.tick

    @tick.setter
    def tick(self, tick: int) -> None:
        self._physics.tick = tick

    def sense(self) -> Samples:
        """Return the samples of the inner plant, changed by the active faults."""
        self._begin_and_end()
        return self._changed(self._physics.sense())

    def observe(self, row: np.ndarray) -> Samples:
        """See `Plant.observe`; the true values are those of the inner plant."""
        self._begin_and_end()
        return self._changed(self._physics.observe(row))

    def _begin_and_end(self) -> None:
        """Find the faults that are active at this tick."""
        self.changed = self.timeline.update(self.time)
        for one in self.changed:
            if one.active:
                now = Occurrence(self._noise[one.number], self.tick)
                self._active[one.number] = one.fault, now
            else:
                del self._active[one.number]
        if self.changed:
            self.senses = any(
                type(fault).sense is not PlantFault.sense for fault, _ in self._active.values()
            )
            self.acts = self.acts or self._acting  # once more after the end: that undoes it

    def _occurring(self) -> Iterator[tuple[PlantFault, Occurrence]]:
        """Yield the active faults. Not every tick is sensed here: time is counted in ticks."""
        for fault, now in self._active.values():
            now.since = (self.tick - now.begun) * self.period
            yield fault, now

    @property
    def _acting(self) -> bool:
        return any(type(fault).act is not PlantFault.act for fault, _ in self._active.values())

    def unchanged_for(self) -> float:
        """Return for how many ticks from this one on no fault begins or ends; inf: to the end."""
        return self.timeline.unchanged_for(self.time) / self.period

    def _changed(self, samples: Samples) -> Samples:
        for fault, now in self._occurring():
            fault.sense(samples, now)
        return samples

    def step(self, motor_commands: np.ndarray, arm_command: np.ndarray, magnet: bool) -> None:
        """Step the inner plant, with commands and physics changed by the active faults."""
        if self.acts:
            commands = PlantCommands(np.array(motor_commands), np.array(arm_command), bool(magnet))
            described = self.vehicle.description
            change = Disturbance.none(len(described.rotors), len(described.joints))
            for fault, now in self._occurring():
                fault.act(commands, change, now)
            if self._physics.DISTURBABLE:
                self._physics.disturb(change)
            motor_commands, arm_command = commands.motors, commands.effort
            magnet = commands.magnet
            self.acts = self._acting
        self._physics.step(motor_commands, arm_command, magnet)

    def truth(self) -> Truth:
        return self._physics.truth()


class DirectFaults:
    """The faults of a flight in the direct engine; decides whether and how late messages arrive.

    It covers cuts, delays, and corruption of messages to the autopilot; `feasibility.needs_nodes`
    lists the faults that the direct engine refuses. `timeline`: of the link's faults.
    """

    def __init__(self, schedule: Schedule, plant: Plant | None = None) -> None:
        """schedule: checked by `feasibility.check`; plant: made with it, if it has faults."""
        self.timeline = Timeline(schedule.only(LINK))
        self._timelines = [self.timeline]
        if isinstance(plant, FaultyPlant):
            self._timelines.append(plant.timeline)
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))

    def receives(self) -> bool:
        """Return whether messages from the autopilot arrive."""
        cuts = (one for one in self.timeline.active if isinstance(one, MavlinkCut))
        return not any(cut.inwards for cut in cuts)

    def passes(self) -> bool:
        """Return whether the next message to the autopilot arrives uncorrupted."""
        return not any(fault.loses(self._noise) for fault in self.timeline.active)

    def late_to(self) -> float:
        """Return the delay [s] of the next message to the autopilot."""
        return sum(one.late(self._noise) for one in self.timeline.active if one.outwards)

    def late_from(self) -> float:
        """Return the delay [s] of the next message from the autopilot."""
        return sum(one.late(self._noise) for one in self.timeline.active if one.inwards)

    def step(self, tick: object) -> Step | None:
        """Return the compiled step of a tick that sets no time; None with faults of the link."""
        return None if self.timeline.all else Step(unchanged, ())

    def update(self, stamp: float, time: float, phase: str) -> None:
        """Set mission time [s] and phase of the control tick at `stamp` [s], for the plant, too."""
        for timeline in self._timelines:
            timeline.mission_at(stamp, time, phase)
        self.timeline.update(stamp)

    @property
    def records(self) -> list[dict[str, Any]]:
        """Return the records of all faults that have begun, in order of time."""
        found = [record for timeline in self._timelines for record in timeline.records]
        return sorted(found, key=lambda record: record["begin_s"])


@borrowing
def unchanged(arrays: tuple) -> int:
    """Do nothing: mission time and phase are as the stamp tells until the objects change them."""
    return DONE
