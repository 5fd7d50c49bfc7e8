"""Flies the steady ticks of a flight: when, and what is copied between objects and loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from operator import is_
from typing import Protocol
from weakref import proxy

import numpy as np

from uam_control.maths.compiled import active, counts_references, prepared
from uam_control.maths.kept_tuple import KeptTuple
from uam_control.stages.autopilot_report import AutopilotReport
from uam_control.stages.bridge_stage import BridgeStage
from uam_control.stages.control_tick import STAGES, ControlTick, take_report
from uam_control.stages.estimator_stage import EstimatorStage
from uam_control.stages.mission_stage import MissionStage
from uam_control.stamps import SECOND
from uam_lab.flights.direct.record import TickRecorder
from uam_lab.flights.direct.steady.bridge import bridge_arrays
from uam_lab.flights.direct.steady.inputs import KeptMessages
from uam_lab.flights.direct.steady.laws import law_arrays
from uam_lab.flights.direct.steady.loop import FAULT, ROW, STAMP, TickArrays, run
from uam_lab.flights.direct.steady.places import END, ERROR, LISTEN, RECORD, WATCH
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.joined import JoinedAutopilot
from uam_sim_bridge.plant import PhysicsError, Plant, Samples
from uam_sim_bridge.plant.engine_step import error_text
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

COMPILES = "compiling the direct engine for this law and vehicle (once)"
LEAST = 2  # ticks for which the copies are worth their time


class Flight(Protocol):
    """What the steady ticks need of a `DirectFlight`; see there."""

    plant: Plant
    control: ControlTick
    autopilot: JoinedAutopilot
    autopilot_imu: bool
    recorder: TickRecorder
    say: Callable[[str], object]

    def delivered(self, samples: Samples) -> tuple:
        """Return the samples for the signals."""

    def finish(self, stage: int, hil: tuple[float, np.ndarray, np.ndarray]) -> None:
        """Finish a tick that steady ticks have begun."""


class SteadyTicks:
    """Flies the steady ticks of a flight.

    `able`: whether the flight may have any; `ticks`: how many it has had.
    """

    def __init__(self, flight: Flight) -> None:
        self._flight, self.ticks = proxy(flight), 0  # the flight owns this object
        stages, plant, port = flight.control, flight.plant, flight.autopilot
        kinds = (  # none of a class of its own
            *((plant, MujocoPlant), (port, JoinedAutopilot), (stages.bridge, BridgeStage)),
            *((stages.estimator, EstimatorStage), (stages.mission, MissionStage)),
        )
        usual = all(type(one) is kind for one, kind in kinds) and stages.stages == list(STAGES)
        self.able = usual and type(port.autopilot) is Autopilot and not flight.autopilot_imu
        if not self.able:
            return
        self.able = plant.compiled and stages.bridge.compiled and port.at_once
        if not self.able:
            return
        self._controllers = [one.controller for one in stages.laws.values()]
        self._steps = tuple(type(one.law).step for one in self._controllers)
        if not all(map(counts_references, self._steps)):  # a law of somebody's own
            self.able = False
            return
        self._inputs = KeptMessages(stages.mission.inputs, self._controllers, plant.joints)
        self._mission = stages.mission
        self._sent = np.zeros(2)
        self._counts, self._biases = np.zeros(5, dtype=np.int64), np.zeros((2, 3))
        self._magnet = np.zeros(1, dtype=np.bool_)
        self._made: tuple = ()
        self._reported = -1  # [ns] tick of the newest report
        self._loop: Callable[[int, int], tuple[int, int]] | None = None

    def fly(self, enough: int, most: int) -> int:
        """Fly until `enough` ticks are flown, at most `most`, while they are steady.

        The objects finish the tick that is not. Returns how many were flown, 0 for none. Raises
        PhysicsError.
        """
        flown, begin = 0, LISTEN
        while self.able and (flown < enough or begin == RECORD):
            count = self._load(most - flown, begin)
            if count < LEAST and begin == LISTEN:
                break
            left = enough - flown, most - flown
            done, end = self._fly(count, begin, *left) if count >= 0 else (0, RECORD)
            flown += done
            self.ticks += done
            if end == ERROR:
                raise PhysicsError(f"MuJoCo: {error_text(self._counts.item(FAULT))}")
            begin = RECORD if end == WATCH else LISTEN
            if end not in (WATCH, END):
                self._flight.finish(end, self._flight.plant.imu(self._flight.plant.tick))
                return flown + 1
        return flown

    def _fly(self, count: int, begin: int, enough: int, most: int) -> tuple[int, int]:
        """Fly after `_load`; return how many ticks ended, and where: see `places`."""
        loop, mission, flown = self._present(), self._mission.mission, 0
        while True:
            done, end = loop(count - mission.looked_ahead, begin)
            flown += done
            if end == WATCH:
                if not mission.watch():
                    break
                begin = RECORD
            elif end == END and flown < enough:
                count, begin = self._renew(most - flown), LISTEN
                if count < LEAST:
                    break
            else:
                break
        self._store(end)
        return flown, end

    def _renew(self, most: int) -> int:
        """Take a report and new noise between two ticks; return as `_load` does."""
        stamp = self._counts.item(STAMP)
        report = self._report()
        if report is not None:
            stages, delays = self._flight.control, (report.round_trip, report.loop_delay)
            known = (math.nan if one is None else one for one in delays)
            stages.mission.inputs.inputs.autopilot(stamp / SECOND, *known)
            stages.measured_delay.report(stamp, report.loop_delay)
        most = min(most, len(self._flight.recorder.table.values) - self._counts.item(ROW))
        most = min(most, self._flight.plant.draw_noise(), self._ticks_to_report(stamp))
        return self._mission.look_ahead(most)

    def _report(self) -> AutopilotReport | None:
        """Make the report that the last compiled tick of the bridge has, if it is not made."""
        bridge = self._flight.control.bridge
        if not self._sent[0] or bridge.last == self._reported:
            return None
        self._reported = bridge.last
        return bridge.reports.due(bridge.last)

    def _ticks_to_report(self, stamp: int) -> int:
        """Return how many ticks after `stamp` [ns] the next report is due."""
        left = self._flight.control.bridge.reports.next - stamp
        return max(1, -(-left // self._mission.period))

    def _load(self, most: int, begin: int) -> int:
        """Copy the state into the arrays; return how many ticks may begin, -1: not steady.

        most: ticks that may end.
        """
        flight = self._flight
        stages, recorder, self._sent[0] = flight.control, flight.recorder, 0.0
        signals, table, half = stages.signals, recorder.table, begin == RECORD
        output = stages.mission.output
        told = output.arm, output.magnet, False, output.regains
        steady = (
            signals.flying
            and signals.phase == output.phase
            and signals.magnet == output.magnet
            and stages._told == told
            and stages.mission.nominal(signals.stamp)
            and stages.bridge.settled
            and flight.autopilot.settled
            and not stages.estimator.held_back
            and self._inputs.load()
        )
        if not steady:
            return -1
        left = self._flight.plant.draw_noise()
        most = min(most, len(table.values) - table.count, left) - half
        most = min(most, self._ticks_to_report(signals.stamp))
        ring = recorder._first, recorder._next
        self._counts[:] = table.count, *ring, signals.stamp, 0
        return stages.mission.look_ahead(most) if most >= 0 else -1

    def _present(self) -> Callable[[int, int], tuple[int, int]]:
        """Return the loop with the arrays of all parts; made anew if objects have changed."""
        flight, stages = self._flight, self._flight.control
        made = (
            flight.recorder.table.values,
            *(one.arrays for one in self._controllers),
            stages.mission.inputs.inputs.arrays,
            *(stages.bridge.map.curve, flight.autopilot.autopilot.arrays),
            stages.mission.mission.arrays,
        )
        same = len(made) == len(self._made) and all(map(is_, made, self._made))
        if not same:
            self._made = made
            recorder = flight.recorder
            arrays = TickArrays(
                flight.plant.arrays,
                stages.estimator.arrays,
                self._inputs.arrays(),
                law_arrays(stages),
                bridge_arrays(stages.bridge, flight.autopilot, self._sent),
                stages.mission.arrays,
                stages.signals.state,
                stages.signals.reference,
                self._biases,
                recorder.table.values,
                recorder._ring,
                flight.autopilot.motors,
                recorder._layout,
                self._counts,
                self._magnet,
            )
            self._kept = kept = KeptTuple(arrays)
            loop = run(self._steps, kept.read)
            if active() and not loop._cache.filled:
                flight.say(COMPILES)
            self._loop = partial(prepared(loop, 0, 0, 0), kept.address)
        self._magnet[0] = stages.signals.magnet
        return self._loop

    def _store(self, end: int) -> None:
        """Copy the state back after a loop that ended in `end`."""
        flight, stages = self._flight, self._flight.control
        signals, plant, recorder = stages.signals, flight.plant, flight.recorder
        row, first, following, stamp, _ = self._counts.tolist()
        observed = end != END
        self._inputs.store()
        stages.mission.resume(signals.state)
        bridge = stages.bridge
        bridge.report = self._report()
        if self._sent[0]:
            bridge.resume(stamp, signals.state, bridge.map.rates, self._sent.item(1))
        newest = plant.tick if observed else plant.tick - 1
        table = recorder.table
        table.phases[table.count : row] = table.phase_names[signals.phase]
        table.count = row
        recorder._first, recorder._next, recorder._lag = first, following, following - first
        flight.autopilot.time = newest * plant.period
        signals.stamp = stamp
        if bridge.report is not None:
            take_report(stages, bridge.report)
        signals.time = stages.mission.time
        signals.thrust_factor, signals.setpoint = bridge.factor, bridge.kept
        if observed:
            found = flight.delivered(plant.arrived())
            signals.mocap, signals.joints, signals.imu, signals.payload = found
