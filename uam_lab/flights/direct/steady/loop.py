"""The compiled loop over steady ticks."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from uam_control.estimation.estimator import write_biases
from uam_control.maths.compiled import borrowing, inlined, jit
from uam_control.maths.memory import put
from uam_control.mission.nominal_tick import watch_due
from uam_control.stages import estimator_stage, mission_stage
from uam_control.stages.estimator_stage import STATE, take_readings, take_sample
from uam_control.stages.vision_pacing import take_pose
from uam_control.stamps import SECOND
from uam_lab.flights.direct.record import MOTORS, RowLayout, record
from uam_lab.flights.direct.steady.bridge import BridgeArrays, cycle, reports, send
from uam_lab.flights.direct.steady.inputs import (
    BIAS,
    JOINTS,
    MOCAP,
    PAYLOAD,
    InputArrays,
    read_inputs,
)
from uam_lab.flights.direct.steady.laws import LawArrays, Steps, control
from uam_lab.flights.direct.steady.places import (
    AUTOPILOT,
    BLIND,
    BRIDGE,
    END,
    ERROR,
    LAWS,
    LISTEN,
    RECORD,
    REFERENCE,
    WATCH,
)
from uam_sim_bridge.plant.plant_tick import PlantArrays, sense, step
from uam_sim_bridge.plant.sensors import PAYLOAD_POSE, VEHICLE_POSE


class TickArrays(NamedTuple):
    """Arrays of all parts.

    state (3, 6 + n): of the estimator; flown (3, 6 + n): reference of the signals; bias (2, 3): for
    the estimated biases; table, ring, layout: of the recording; motors (rotors,): of the autopilot;
    counts: see ROW to FAULT; magnet (1,): whether it is on.
    """

    plant: PlantArrays
    estimation: estimator_stage.StageArrays
    inputs: InputArrays
    laws: LawArrays
    bridge: BridgeArrays
    mission: mission_stage.StageArrays
    state: np.ndarray
    flown: np.ndarray
    bias: np.ndarray
    table: np.ndarray
    ring: np.ndarray
    motors: np.ndarray
    layout: RowLayout
    counts: np.ndarray
    magnet: np.ndarray


# entries of `counts`: row of the recording, ticks of its ring (first, next), stamp [ns] of the
# state, address of an error's text
ROW, FIRST, NEXT, STAMP, FAULT = range(5)


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
                if not control_all(a.laws, a.counts[STAMP], a.state, a.flown, a.inputs):
                    return done, LAWS
                end = decide(a)
                if end != RECORD:
                    return done, end
            begin = LISTEN
            end = end_tick(a)
            if end != END:
                return done, end
            done += 1
            if reports(a.bridge):
                return done, END

    return steady_run


@jit
def stamp_of(time: float) -> int:
    """Return the stamp [ns] of a time [s]; see `nanoseconds`."""
    return int(np.rint(time * 1e6)) * 1000


@inlined
def begin_tick(a: TickArrays) -> int:
    """Do the stages from the sensors to the mission; return LAWS, or where they end."""
    s, c, i = a.plant, a.counts, a.inputs
    rotors = len(a.motors)
    ring = a.ring[c[NEXT] % len(a.ring)]
    sense(s, ring[MOTORS + rotors :])
    m, mocap = s.numbers[0], s.mocap
    slot, payload_slot = mocap.arrived[VEHICLE_POSE], mocap.arrived[PAYLOAD_POSE]
    joints = s.observed.alpha.shape[0]
    at = m.tick - m.joints_late
    row = s.samples[at % len(s.samples)]
    joint_stamp = stamp_of(at * m.period)
    angles, speeds = row[6 : 6 + joints], row[6 + joints : 6 + 2 * joints]
    pose = mocap.poses[VEHICLE_POSE, max(slot, 0)]
    position, quaternion, pose_stamp = pose[1:4], pose[4:8], -1
    if slot >= 0:
        pose_stamp = stamp_of(pose[0])
        exposed = pose_stamp / SECOND
        if take_pose(a.bridge.vision, exposed, position, quaternion, True):
            a.bridge.seen[0] = exposed
            put(quaternion, a.bridge.seen[1:])
        i.kept[MOCAP], i.at[MOCAP] = True, pose_stamp
        put(pose[1:], i.mocap)
    i.kept[JOINTS], i.at[JOINTS] = True, joint_stamp
    put(row[6 + 2 * joints :], i.effort)
    if payload_slot >= 0:
        payload = mocap.poses[PAYLOAD_POSE, payload_slot]
        i.kept[PAYLOAD], i.at[PAYLOAD] = True, stamp_of(payload[0])
        put(payload[1:4], i.payload)
    at = m.tick - m.imu_late
    sample, stamp = s.samples[at % len(s.samples)], stamp_of(at * m.period)
    if slot >= 0:
        estimator_stage.take_pose(a.estimation, pose_stamp, position, quaternion)
    take_readings(a.estimation, joint_stamp, angles, speeds)
    if take_sample(a.estimation, stamp, sample[0:3], sample[3:6]) != STATE:
        return BLIND
    c[STAMP] = stamp
    read_inputs(i, stamp)
    if a.estimation.numbers[0].bias_due:
        write_biases(a.estimation.estimator.pose.memory, a.bias)
        i.kept[BIAS], i.at[BIAS] = True, stamp / SECOND
        put(a.bias[1], i.bias)
    mission_stage.begin_tick(a.mission, stamp)
    for row in range(len(a.flown)):
        put(a.mission.mission.guidance.reference[row], a.flown[row])
    return LAWS


@inlined
def decide(a: TickArrays) -> int:
    """Do the stages bridge and next reference; return RECORD, or where they end."""
    c, m, laws = a.counts, a.plant.numbers[0], a.laws
    stamp, tau_p, tau_q = c[STAMP], laws.position.all.tau, laws.attitude.all.tau
    time = m.tick * m.period
    if not send(
        *(a.bridge, stamp, time, a.state, tau_p, tau_q, laws.position.attitude, a.inputs),
    ):
        return BRIDGE
    if not mission_stage.advance(a.mission, a.inputs.inputs.known, stamp, a.state):
        return REFERENCE
    return WATCH if watch_due(a.mission.mission) else RECORD


@inlined
def end_tick(a: TickArrays) -> int:
    """Record the tick, run the autopilot and the physics; return END, or where they end."""
    c, s, m, bridge = a.counts, a.plant, a.plant.numbers[0], a.bridge
    position, attitude, arm = a.laws.position, a.laws.attitude, a.laws.arm
    time = m.tick * m.period
    magnet = 1.0 if a.magnet[0] else 0.0
    stamp = c[STAMP] / SECOND - m.period / 2.0
    c[FIRST] = record(
        *(a.table, c[ROW], a.ring, c[FIRST], c[NEXT], time, a.motors, magnet, stamp),
        *(a.mission.numbers[0].time, a.state, a.flown, position.attitude),
        *(position.all.tau, attitude.all.tau, arm.all.tau, bridge.rates, bridge.sent[1]),
        *(bridge.bridge[0].factor, a.layout),
    )
    c[NEXT] += 1
    c[ROW] += 1
    sample = s.samples[m.tick % len(s.samples)]
    if not cycle(bridge, time, sample[0:3], sample[3:6]):
        return AUTOPILOT
    c[FAULT] = step(s, a.motors, arm.command, a.magnet[0])
    return ERROR if c[FAULT] else END
