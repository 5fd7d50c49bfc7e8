"""Compiled ticks: the stages of a direct flight on their own memory, many ticks in one call.

Most ticks of a flight only compute: no phase changes, no limit is near, nobody takes over. Python
needs most of their time for the way from one compiled function to the next. Here the compiled steps
of all stages, in the order of `ControlTick.stages`, with the sensors before them, recording,
autopilot and physics behind them, are one loop.

A step that has something to decide changes nothing, and says so. Then the loop ends there, and the
objects do this stage and the rest of the tick. So all decisions are made by the objects, and a
recording is the same bit for bit (tests/flights/test_compiled_ticks.py).

A part of the tick without a compiled step (a fault, a law, an effect or a setpoint of
somebody's own) is a function in Python, which the loop calls in its turn.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, wraps
from operator import is_
from typing import Any
from weakref import proxy

import numpy as np

from uam_control.maths.compiled import borrowing, jit, on_disk
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import put
from uam_control.stages.bridge_stage import BridgeStage, unreported
from uam_control.stages.control_tick import take_report
from uam_control.stages.mission_stage import MissionStage
from uam_control.stages.signals import GRIP, IMU, JOINTS, NOTHING, PAYLOAD, POSES, SignalArrays
from uam_control.stages.step import ASK, DECIDE, DONE, ENDED, MANY, Step, Steps
from uam_lab.flights.direct.record import MOTORS, record_step
from uam_sim_bridge.autopilot.joined import cycle_step
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.observation import sense, step
from uam_sim_bridge.plant.sensors import PAYLOAD_POSE, VEHICLE_POSE, WAITING, MocapArrays

COMPILES = "compiling the direct engine for this law and vehicle (once)"
LEAST = 2  # ticks for which the preparations are worth their time
USUAL = {"mission": MissionStage, "bridge": BridgeStage}


def _safely(method: Callable[..., int]) -> Callable[..., int]:
    """Let a method keep what it raises: an error could not come out of the loop from there."""

    @wraps(method)
    def kept(self: CompiledTicks, argument: object) -> int:
        try:
            return method(self, argument)
        except BaseException as error:
            self._error = error
            return ENDED

    return kept


class CompiledTicks:
    """Flies the compiled ticks of a flight; `ticks`: how many it has flown."""

    def __init__(self, flight: Any) -> None:
        """flight: a `DirectFlight`, whose module imports this one."""
        self._flight, self.ticks = proxy(flight), 0  # the flight owns this object
        self._sample = np.zeros((2, 3))  # of the autopilot's IMU: gyro, specific force, FLU
        self._fault = np.zeros(1, dtype=np.int64)  # address of the text of MuJoCo's error
        self._made: tuple = ()

    def fly(self, enough: int, most: int) -> int:
        """Fly until `enough` ticks are flown, at most `most`, while nothing is decided.

        The objects finish the tick in which something is. Returns how many were flown, 0 for none.
        Raises PhysicsError.
        """
        flown, end = 0, 0
        while flown < enough and not end and self._nominal():
            self._arrange()
            count = self._renew(most - flown)
            if count < LEAST:
                break
            done, end = self._stretch(count, enough - flown, most - flown)
            flown += done
            self.ticks += done
        return flown + (end != 0)

    def _nominal(self) -> bool:
        """Return whether nothing is to be decided before a compiled step says so."""
        flight, control = self._flight, self._flight.control
        signals, mission = control.signals, control.mission
        output = mission.output
        told = output.arm, output.magnet, False, output.regains
        usual = all(type(getattr(control, name)) is kind for name, kind in USUAL.items())
        return (
            signals.flying
            and usual
            and flight.autopilot.armed
            and signals.phase == output.phase
            and signals.magnet == output.magnet
            and control.told == told
            and mission.nominal(signals.stamp)
            and (not self._joined or (control.bridge.settled and flight.autopilot.settled))
            and not control.estimator.held_back
        )

    @property
    def _joined(self) -> bool:
        """Whether bridge and autopilot have compiled steps."""
        return self._flight.autopilot.steps is not None and self._flight.control.bridge.compiled

    def _arrange(self) -> None:
        """Make the steps, if objects have changed since."""
        flight, control = self._flight, self._flight.control
        flight.recorder.fit()
        made = (
            *(one.controller.arrays for one in control.laws.values()),
            *(type(one.controller.law).step for one in control.laws.values()),
            *(control.mission.inputs.arrays, control.mission.mission.arrays),
            *(control.bridge.map.curve, flight.autopilot.autopilot.arrays),
            *(self._sampled, self._stepped),
            *(flight.autopilot.steps, flight.recorder.arrays),
        )
        if len(made) != len(self._made) or not all(map(is_, made, self._made)):
            self._made = made
            self._make()

    def _make(self) -> None:
        """Make the loop over the steps; where there is none, over the objects' functions."""
        flight, control = self._flight, self._flight.control
        names = [stage.name for stage in control.stages]
        self._mission = 1 + names.index("mission")
        stages = [stage.step(control) for stage in control.stages]
        left = zip(control.stages, stages, strict=True)
        asks = any(stage.decides and step is None for stage, step in left)
        before = None if None in stages[: self._mission] else self._sensors()
        around = before, self._cycle(), self._physics()
        steps = [before, *stages, Step(record_step, (flight.recorder.arrays,)), *around[1:]]
        self._sensed = before is not None
        if not all(on_disk(step.function) for step in steps if step):
            flight.say(COMPILES)
        runs = (partial(stage.run, control) for stage in control.stages)
        # not the methods themselves: they hold the flight, which holds this object
        objects = lambda: flight.sense(), lambda: flight.cycle(), lambda: flight.push()
        self._in_python = [objects[0], *runs, None, *objects[1:]]
        me = proxy(self)
        parts = [step or (lambda place=place: me._do(place)) for place, step in enumerate(steps)]
        question = Step(unreported, (control.bridge.arrays,))
        if asks:
            asked = bound(*question)
            question = lambda: me._may_go_on(asked)  # noqa: E731
        self._steps = Steps(parts, 1 + len(stages), question)

    @property
    def _compiled_plant(self) -> bool:
        plant = self._flight.plant.physics
        return type(plant) is MujocoPlant and plant.compiled

    @property
    def _sampled(self) -> bool:
        return self._compiled_plant and not self._flight.plant.senses

    @property
    def _stepped(self) -> bool:
        """Whether a compiled step advances the physics."""
        return self._compiled_plant and not self._flight.plant.acts

    def _sensors(self) -> Step | None:
        flight, arrays = self._flight, self._flight.recorder.arrays
        if not (self._sampled and self._joined) or flight.autopilot_imu:
            return None
        of_tick = arrays.ring, arrays.motors, arrays.numbers, flight.autopilot.memory
        plant = flight.plant.physics
        return Step(sense_step, (plant.arrays, arrays.signals, self._sample, *of_tick))

    def _cycle(self) -> Step | None:
        if not self._joined:
            return None
        return Step(cycle_step, (self._sample, self._flight.autopilot.arrays))

    def _physics(self) -> Step | None:
        flight, arrays = self._flight, self._flight.recorder.arrays
        if not self._stepped:
            return None
        command = flight.control.signals.arm_command
        of_tick = arrays.motors, command, arrays.numbers, self._fault
        return Step(push_step, (flight.plant.physics.arrays, *of_tick))

    def _stretch(self, count: int, enough: int, most: int) -> tuple[int, int]:
        """Fly until `enough` ticks are flown, at most `most`; count: those made ready.

        Returns how many ended, and whether the objects have ended a further one.
        """
        mission, flown, whole = self._flight.control.mission.mission, 0, True
        self._flight.recorder.begin(0.0, self._flight.control.signals.magnet)
        while True:
            done, end = self._run(count - mission.looked_ahead, whole)
            flown, whole = flown + done, True
            if end > 0 and end % MANY == ASK and mission.watch():
                whole = False
            elif end or flown >= enough:
                break
            else:
                self._take_report()
                count = self._renew(most - flown) if self._nominal() else 0
                if count < LEAST:
                    break
        self._resume()
        if end:
            self._finish(end)
        return flown, end

    def _renew(self, most: int) -> int:
        """Make ready for at most `most` ticks; return for how many."""
        control, plant = self._flight.control, self._flight.plant
        if self._compiled_plant:
            most = min(most, plant.physics.draw_noise())
        most = int(min(most, plant.unchanged_for()))
        most = min(most, self._flight.autopilot.network.draw())
        left = control.bridge.reports.next - control.signals.stamp
        to_report = max(1, -(-left // control.mission.period))
        return control.mission.look_ahead(min(most, self._flight.recorder.left, to_report))

    def _take_report(self) -> None:
        control = self._flight.control
        signals = control.signals
        report = control.bridge.resume(signals.stamp, signals.state)
        if report is not None:
            take_report(control, report)

    def _resume(self) -> None:
        """Let the objects know what compiled ticks have done."""
        flight, control = self._flight, self._flight.control
        control.mission.resume(control.signals.state)
        self._take_report()
        control.signals.setpoint = control.bridge.kept
        flight.recorder.resume(control.signals.phase)

    def _finish(self, end: int) -> None:
        """Let the objects finish the tick of a loop that ended in `end`, see `Steps`."""
        flight, place, outcome = self._flight, abs(end) // MANY, abs(end) % MANY
        if self._sensed:
            flight.resume()
        if end > 0 and outcome == DECIDE:
            flight.go_on(place - 1)
            return
        if end > 0 and outcome != ASK:
            flight.recorder.write_blind(flight.control.mission.output.phase)
        elif end > 0:
            flight.recorder.write(flight.control.signals.phase)
        if end > 0 or place == 1:
            flight.cycle()
        elif self._fault[0]:
            raise flight.plant.physics.failure(self._fault.item(0))
        flight.push()

    def _run(self, count: int, whole: bool) -> tuple[int, int]:
        """Fly up to `count` ticks, see `Steps`. Raises what a part in Python raises."""
        self._error = None
        done, end = self._steps(count, whole)
        if self._error is not None:
            raise self._error
        return done, end

    @_safely
    def _may_go_on(self, asked: Callable[[], int]) -> int:
        """Answer the question after a tick with a part in Python that may decide."""
        outcome = asked()
        return outcome if outcome != DONE or self._nominal() else ASK

    @_safely
    def _do(self, place: int) -> int:
        """Do a part in Python; say its outcome."""
        control = self._flight.control
        if 0 < place < len(self._in_python) - 1:  # the plant needs neither
            self._take_report()
            control.signals.setpoint = control.bridge.kept
        goes_on = self._in_python[place]()
        if place == 0:
            self._sample[:] = self._flight.newest[1:]
        if place < self._mission:
            control.signals.put(control.arrays)
        return ENDED if goes_on is False else DONE


@borrowing
def sense_step(arrays: tuple) -> int:
    """Take the samples of a tick, as `DirectFlight.sense`."""
    plant, s, sample, ring, motors, numbers, port = arrays
    tick, m = numbers[0], plant.numbers[0]
    tick.time = m.tick * m.period
    port[0].time = tick.time
    sense(plant, ring[tick.following % len(ring)][MOTORS + len(motors) :])
    deliver_poses(plant.mocap, s)
    taken, n = m.tick - m.joints_late, s.joints.shape[1]
    s.stamps[JOINTS] = stamp_of(taken * m.period)
    for i in range(3):
        put(plant.samples[taken % len(plant.samples)][6 + i * n :], s.joints[i])
    s.stamps[GRIP] = NOTHING
    if len(plant.body.opening):
        s.stamps[GRIP] = s.stamps[JOINTS]
        put(plant.samples[taken % len(plant.samples)][6 + 3 * n :], s.grip)
    taken = m.tick - m.imu_late
    s.stamps[IMU] = stamp_of(taken * m.period)
    put_imu(plant.samples[taken % len(plant.samples)], s.imu)
    put_imu(plant.samples[m.tick % len(plant.samples)], sample)
    return DONE


@borrowing
def deliver_poses(mocap: MocapArrays, s: SignalArrays) -> None:
    """Give the stages the poses of a tick: POSES of the vehicle at most, the payload's newest."""
    count = min(mocap.arrived[VEHICLE_POSE], POSES)
    for i in range(count):
        pose = mocap.poses[VEHICLE_POSE, (mocap.first[VEHICLE_POSE] - count + i) % WAITING]
        s.exposed[i] = stamp_of(pose[0])
        put(pose[1:], s.poses[i])
    if count < POSES:
        s.exposed[count] = NOTHING
    s.stamps[PAYLOAD] = NOTHING
    if mocap.arrived[PAYLOAD_POSE]:
        pose = mocap.poses[PAYLOAD_POSE, (mocap.first[PAYLOAD_POSE] - 1) % WAITING]
        s.stamps[PAYLOAD] = stamp_of(pose[0])
        put(pose[1:], s.payload)


@borrowing
def put_imu(row: np.ndarray, into: np.ndarray) -> None:
    """Copy gyro and specific force from a row of the plant's samples to into (2, 3)."""
    put(row, into[0])
    put(row[3:], into[1])


@jit
def stamp_of(time: float) -> int:
    """Return the stamp [ns] of a time [s]; see `nanoseconds`."""
    return int(np.rint(time * 1e6)) * 1000


@borrowing
def push_step(arrays: tuple) -> int:
    """Advance the physics by a tick, as `DirectFlight.push`; DECIDE: of an error."""
    plant, motors, command, numbers, fault = arrays
    fault[0] = step(plant, motors, command, numbers[0].magnet != 0)
    return DECIDE if fault[0] else DONE
