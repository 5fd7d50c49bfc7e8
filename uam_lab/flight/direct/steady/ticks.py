"""The loop over steady ticks, and the object that a flight calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from operator import is_
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uam_control.estimation.estimator import write_biases
from uam_control.maths.compiled import borrowing, counts_references, inlined, prepared
from uam_control.maths.kept_tuple import KeptTuple
from uam_control.stamps import SECOND, nanoseconds
from uam_lab.flight.direct.record import MOTORS, RowLayout, record
from uam_lab.flight.direct.steady.bridge import BridgeArrays, BridgePart, send, take_pose
from uam_lab.flight.direct.steady.cycle import CycleArrays, CyclePart, cycle
from uam_lab.flight.direct.steady.estimation import (
    NOTHING,
    STEADY,
    Estimation,
    EstimationPart,
    estimate,
)
from uam_lab.flight.direct.steady.inputs import (
    BIAS,
    JOINTS,
    MOCAP,
    PAYLOAD,
    InputArrays,
    InputsPart,
    read_inputs,
)
from uam_lab.flight.direct.steady.laws import (
    ArmArrays,
    ArmPart,
    AttitudeArrays,
    AttitudePart,
    LawPart,
    PositionArrays,
    Steps,
    attitude_arrays,
    control,
    position_arrays,
)
from uam_lab.flight.direct.steady.memory import put
from uam_lab.flight.direct.steady.places import (
    AUTOPILOT,
    BRIDGE,
    DIVERGE,
    END,
    ERROR,
    ESTIMATE,
    LAWS,
    LISTEN,
    RECORD,
    REFERENCE,
    WATCH,
)
from uam_lab.flight.direct.steady.reference import (
    ReferenceArrays,
    ReferencePart,
    advance,
    watch_due,
)
from uam_lab.flight.direct.steady.sensing import (
    PAYLOAD as PAYLOAD_POSE,
)
from uam_lab.flight.direct.steady.sensing import (
    RING,
    VEHICLE,
    Sensing,
    SensingPart,
    sense,
    stamp_of,
    step,
)
from uam_sim_bridge.plant import PhysicsError
from uam_sim_bridge.plant.engine_step import error_text
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.stages.control_tick import STAGES, take_report

if TYPE_CHECKING:
    from uam_lab.flight.direct.flight import DirectFlight

LEAST = 2  # ticks for which the copies are worth their time


class TickArrays(NamedTuple):
    """Arrays of all parts.

    state (3, 6 + n): of the estimator; flown (3, 6 + n): reference of the signals; bias (2, 3): for
    the estimated biases; table, ring, layout: of the recording; motors (rotors,): of the autopilot;
    counts: see ROW to FAULT; magnet (1,): whether it is on.
    """

    sensing: Sensing
    estimation: Estimation
    inputs: InputArrays
    position: PositionArrays
    attitude: AttitudeArrays
    arm: ArmArrays
    bridge: BridgeArrays
    reference: ReferenceArrays
    autopilot: CycleArrays
    state: np.ndarray
    flown: np.ndarray
    bias: np.ndarray
    table: np.ndarray
    ring: np.ndarray
    motors: np.ndarray
    layout: RowLayout
    counts: np.ndarray
    magnet: np.ndarray


# entries of `counts`: row of the recording, ticks of its ring (first, next), slot of the pose that
# arrives (-1: none), stamp [ns] of state and of the mission's begin (0: none), whether a setpoint
# was sent, cycles of the autopilot, address of an error's text
ROW, FIRST, NEXT, SLOT, STAMP, BEGUN, SENT, CYCLES, FAULT = range(9)


class SteadyTicks:
    """Flies the steady ticks of a `DirectFlight`.

    `able`: whether the flight may have any; `ticks`: how many it has had.
    """

    def __init__(self, flight: DirectFlight) -> None:
        self._flight, self.ticks = flight, 0
        stages, plant = flight.control, flight.plant
        self.able = type(plant) is MujocoPlant and stages.stages == list(STAGES)
        if not self.able:
            return
        self._sensing, self._bridge = SensingPart(plant), BridgePart(stages.bridge)
        self.able = self._sensing.able() and self._bridge.able() and not flight.autopilot_imu
        if not self.able:
            return
        laws = (stages.position, stages.attitude, stages.arm)
        self._steps = tuple(type(one.controller.law).step for one in laws)
        if not all(map(counts_references, self._steps)):  # a law of somebody's own
            self.able = False
            return
        self._estimation = EstimationPart(stages.estimator)
        self._laws = (
            LawPart(stages.position),
            AttitudePart(stages.attitude, stages.measured_delay),
            ArmPart(stages.arm),
        )
        self._controllers = [part.stage.controller for part in self._laws]
        self._inputs = InputsPart(stages.mission.inputs, self._controllers, plant.joints)
        self._reference = ReferencePart(stages.mission)
        self._cycle = CyclePart(flight.autopilot)
        self._counts, self._biases = np.zeros(9, dtype=np.int64), np.zeros((2, 3))
        self._magnet = np.zeros(1, dtype=np.bool_)
        self._made: tuple = ()
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
                self._flight.finish(end, self._sensing.imu(self._flight.plant.tick))
                return flown + 1
        return flown

    def _fly(self, count: int, begin: int, enough: int, most: int) -> tuple[int, int]:
        """Fly after `_load`; return how many ticks ended, and where: see `places`."""
        loop, reference, flown = self._present(), self._reference, 0
        state = self._flight.control.signals.state
        while True:
            done, end = loop(count - reference.advanced, begin)
            flown += done
            if end == WATCH:
                self._inputs.store_readings()
                if not reference.watch(state):
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
        report, stamp = self._bridge.report(), self._counts.item(STAMP)
        if report is not None:
            self._inputs.report(stamp, (report.round_trip, report.loop_delay))
            if not self._laws[1].report(stamp, report.loop_delay):
                return -1
        most = min(most, len(self._flight.recording.values) - self._counts.item(ROW))
        most = min(most, self._sensing.renew(), self._ticks_to_report(stamp))
        return self._reference.renew(self._flight.control.signals.state, most)

    def _ticks_to_report(self, stamp: int) -> int:
        """Return how many ticks after `stamp` [ns] the next report is due."""
        return max(1, -((stamp - self._bridge.due) // self._reference.period))

    def _load(self, most: int, begin: int) -> int:
        """Copy the state into the arrays; return how many ticks may begin, -1: not steady.

        most: ticks that may end.
        """
        stages, recorder = self._flight.control, self._flight.recorder
        signals, table, half = stages.signals, recorder.table, begin == RECORD
        output, reference, bridge = stages.mission.output, self._reference, self._bridge
        told = output.arm, output.magnet, False, output.regains
        steady = (
            signals.flying
            and signals.phase == output.phase
            and signals.magnet == output.magnet
            and stages._told == told
            and reference.steady(signals.stamp)
            and bridge.load()
            and self._cycle.load()
            and self._estimation.load()
            and self._inputs.load()
            and all(part.load() for part in self._laws)
        )
        if not steady:
            return -1
        most = min(most, len(table.values) - table.count, self._sensing.load(half)) - half
        most = min(most, self._ticks_to_report(signals.stamp))
        ring = recorder._first, recorder._next
        self._counts[:] = table.count, *ring, -1, signals.stamp, *(0,) * 4
        return reference.load(signals.stamp, most) if most >= 0 else -1

    def _present(self) -> Callable[[int, int], tuple[int, int]]:
        """Return the loop with the arrays of all parts; made anew if objects have changed."""
        flight, stages = self._flight, self._flight.control
        made = (
            *(flight.recording.values, stages.estimator.estimator),
            *(one.parameters for one in self._controllers),
            *(stages.bridge.map._flat, flight.autopilot.autopilot._loop),
            *(stages.mission.mission._guidance, stages.mission.mission._parameters),
        )
        same = len(made) == len(self._made) and all(map(is_, made, self._made))
        if not same:
            self._made = made
            recorder = flight.recorder
            arrays = TickArrays(
                self._sensing.arrays,
                self._estimation.arrays,
                self._inputs.arrays,
                position_arrays(self._laws[0]),
                attitude_arrays(self._laws[1]),
                self._laws[2].arm_arrays(),
                self._bridge.arrays(),
                self._reference.arrays(),
                self._cycle.arrays(),
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
            self._loop = partial(run(self._steps, kept.read), kept.address)
        self._magnet[0] = stages.signals.magnet
        return self._loop

    def _store(self, end: int) -> None:
        """Copy the state back after a loop that ended in `end`."""
        flight, stages = self._flight, self._flight.control
        signals, plant, recorder = stages.signals, flight.plant, flight.recorder
        row, first, following, slot, stamp, begun, sent, cycles, _ = self._counts.tolist()
        observed = end != END
        self._sensing.store(observed)
        self._estimation.store()
        self._inputs.store()
        for part in self._laws:
            part.store()
        self._reference.store(signals.state)
        self._bridge.store(signals.state, stamp / SECOND, bool(sent))
        newest = plant.tick if observed else plant.tick - 1
        if cycles:
            self._cycle.store(self._sensing.imu(plant.tick - 1))
        table = recorder.table
        table.phases[table.count : row] = table.phase_names[signals.phase]
        table.count = row
        recorder._first, recorder._next, recorder._lag = first, following, following - first
        flight.autopilot.time = newest * plant.period
        signals.stamp = stamp
        if stages.bridge.report is not None:
            take_report(stages, stages.bridge.report)
        if begun:
            signals.time = self._reference.begun(begun)
        signals.thrust_factor, signals.setpoint = stages.bridge.factor, stages.bridge._kept
        if observed:
            signals.imu, signals.joints, signals.mocap, signals.payload = self._samples(slot)

    def _samples(self, slot: int) -> tuple:
        """Return the samples of IMU, joints, mocap and payload that have arrived at this tick."""
        sensing, plant = self._sensing, self._flight.plant
        found = [
            sensing.imu(plant.tick - plant._imu_delay.ticks),
            sensing.joints(plant.tick - plant._joints_delay.ticks),
            None if slot < 0 else sensing.pose(slot, VEHICLE),
            None if slot < 0 or not plant._tracks_payload else sensing.pose(slot, PAYLOAD_POSE),
        ]
        return tuple(one and (nanoseconds(one[0]), *one[1:]) for one in found)


@cache
def run(steps: Steps, arrays: Callable[[int], TickArrays]) -> Callable[[int, int, int], tuple]:
    """Return the compiled loop; steps: of the laws; arrays: see `KeptTuple.read`."""
    control_all = control(steps)

    @borrowing
    def steady_run(address: int, count: int, begin: int) -> tuple[int, int]:
        """Begin up to `count` ticks and end them; begin: LISTEN, or RECORD to end one first.

        Returns the number of ticks that ended, and where the loop ended.
        """
        a = arrays(address)
        done = 0
        while True:
            if begin == LISTEN:
                if count == 0:
                    return done, END
                count -= 1
                end = begin_tick(a)
                if end != LAWS:
                    return done, end
                control_all(
                    *(a.position, a.attitude, a.arm, a.reference.memory[0].period),
                    *(a.counts[STAMP], a.state, a.flown, a.inputs),
                )
                end = decide(a)
                if end != RECORD:
                    return done, end
            begin = LISTEN
            end = end_tick(a)
            if end != END:
                return done, end
            done += 1
            if a.bridge.memory[0].reported:
                return done, END

    return prepared(steady_run, 0, 0, 0)


@inlined
def begin_tick(a: TickArrays) -> int:
    """Do the stages from the sensors to the mission; return LAWS, or where they end."""
    s, c, i = a.sensing, a.counts, a.inputs
    rotors = len(a.motors)
    ring = a.ring[c[NEXT] % len(a.ring)]
    sense(s, ring[MOTORS + rotors :])
    m = s.memory[0]
    slot = c[SLOT] = m.pose
    joints = s.observed.alpha.shape[0]
    at = m.tick - m.joints_late
    row = s.samples[at % RING]
    joint_stamp = stamp_of(at * m.period)
    angles, speeds = row[6 : 6 + joints], row[6 + joints : 6 + 2 * joints]
    pose = s.poses[max(slot, 0), VEHICLE]
    position, quaternion, pose_stamp = pose[1:4], pose[4:8], -1
    if slot >= 0:
        pose_stamp = stamp_of(pose[0])
        if not take_pose(a.bridge, pose_stamp / SECOND, position, quaternion):
            return LISTEN
        i.kept[MOCAP], i.at[MOCAP] = True, pose_stamp
        put(pose[1:], i.mocap)
    i.kept[JOINTS], i.at[JOINTS] = True, joint_stamp
    put(row[6 + 2 * joints :], i.effort)
    if slot >= 0 and m.tracks:
        payload = s.poses[slot, PAYLOAD_POSE]
        i.kept[PAYLOAD], i.at[PAYLOAD] = True, stamp_of(payload[0])
        put(payload[1:4], i.payload)
    at = m.tick - m.imu_late
    sample, stamp = s.samples[at % RING], stamp_of(at * m.period)
    found = estimate(
        *(a.estimation, stamp, sample[0:3], sample[3:6], pose_stamp, position, quaternion),
        *(joint_stamp, angles, speeds, a.state),
    )
    if found != STEADY:
        return ESTIMATE if found == NOTHING else DIVERGE
    c[STAMP] = stamp
    if a.estimation.memory[0].bias_due:
        write_biases(a.estimation.pose, a.bias)
        i.kept[BIAS], i.at[BIAS] = True, stamp / SECOND
        put(a.bias[1], i.bias)
    read_inputs(i, stamp)
    c[BEGUN] = stamp
    a.reference.memory[0].begun = a.reference.memory[0].time
    for row in range(len(a.flown)):
        put(a.reference.reference[row], a.flown[row])
    return LAWS


@inlined
def decide(a: TickArrays) -> int:
    """Do the stages bridge and next reference; return RECORD, or where they end."""
    c, m = a.counts, a.sensing.memory[0]
    stamp, tau_p, tau_q = c[STAMP], a.position.law.tau, a.attitude.law.tau
    time = m.tick * m.period
    if not send(
        *(a.bridge, stamp, time, a.state, tau_p, tau_q, a.position.attitude, a.inputs),
    ):
        return BRIDGE
    c[SENT] = 1
    if not advance(a.reference, a.inputs, stamp, a.state):
        return REFERENCE
    return WATCH if watch_due(a.reference) else RECORD


@inlined
def end_tick(a: TickArrays) -> int:
    """Record the tick, run the autopilot and the physics; return END, or where they end."""
    c, s, m, bridge = a.counts, a.sensing, a.sensing.memory[0], a.bridge.memory[0]
    time = m.tick * m.period
    magnet = 1.0 if a.magnet[0] else 0.0
    stamp = c[STAMP] / SECOND - m.period / 2.0
    c[FIRST] = record(
        *(a.table, c[ROW], a.ring, c[FIRST], c[NEXT], time, a.motors, magnet, stamp),
        *(a.reference.memory[0].begun, a.state, a.flown, a.position.attitude),
        *(a.position.law.tau, a.attitude.law.tau, a.arm.law.tau, a.bridge.rates, bridge.sent),
        *(bridge.used, a.layout),
    )
    c[NEXT] += 1
    c[ROW] += 1
    sample = s.samples[m.tick % RING]
    if not cycle(a.autopilot, a.bridge, time, sample[0:3], sample[3:6]):
        return AUTOPILOT
    c[CYCLES] += 1
    c[FAULT] = step(s, a.motors, a.arm.command, a.magnet[0])
    return ERROR if c[FAULT] else END
