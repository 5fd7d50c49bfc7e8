"""Bridge, its link to the autopilot, and the autopilot: a tick in which nothing is decided."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.ages import age_by
from uam_control.frames import swap_quaternion, swap_sample, swap_world
from uam_control.maths.compiled import borrowing, jit
from uam_control.offboard.sequence import LINK_GAP
from uam_control.setpoints.level_hold import follow_thrust
from uam_control.setpoints.loop_delay import DelayNumbers
from uam_control.setpoints.rate_thrust_map import rate_thrust_of_state, use_factor
from uam_control.stages.bridge_stage import LIFT_PERIOD, LONGEST_STEP, BridgeStage
from uam_control.stages.flight_measurements import MeasurementArrays, measure
from uam_control.stages.vision_pacing import VisionArrays, pose_due
from uam_control.stamps import SECOND
from uam_lab.flights.direct.steady.inputs import LIFT, InputArrays
from uam_sim_bridge.autopilot.commander import take_setpoint
from uam_sim_bridge.autopilot.core import CycleArrays, fly_rates, take_vision
from uam_sim_bridge.autopilot.joined import JoinedAutopilot, begin_poll, report


class BridgeArrays(NamedTuple):
    """Arrays of the objects: of the map, rates (3,) [rad/s, FLU]: its output, curve: of its thrust;
    of the measurements; seen (5,): newest pose; memories (1,) of level hold, sequence, reports,
    bridge and port; gyro, force (3,): newest sample, FRD. sent (2,): whether a setpoint was sent
    since the loop began, and its thrust.
    """

    map: np.ndarray
    flat: np.ndarray
    rates: np.ndarray
    curve: tuple[float, float, float, float]
    measured: MeasurementArrays
    delay_numbers: DelayNumbers
    vision: VisionArrays
    seen: np.ndarray
    hold: np.ndarray
    sequence: np.ndarray
    reports: np.ndarray
    bridge: np.ndarray
    port: np.ndarray
    autopilot: CycleArrays
    gyro: np.ndarray
    force: np.ndarray
    sent: np.ndarray


def bridge_arrays(bridge: BridgeStage, port: JoinedAutopilot, sent: np.ndarray) -> BridgeArrays:
    """Return the arrays of a bridge and its autopilot."""
    measured, source, mapping = bridge.measurements, bridge.source, bridge.map
    return BridgeArrays(
        *(mapping.memory, mapping.flat, mapping.rates, mapping.curve),
        *(measured.arrays, bridge.loop_delay.numbers, bridge.vision.arrays),
        *(source.seen, source.hold.memory, bridge.sequence.memory, bridge.reports.memory),
        *(bridge.memory, port.memory, port.autopilot.arrays, *port.own_sample, sent),
    )


@borrowing
def send(
    a: BridgeArrays,
    stamp: int,
    time: float,
    state: np.ndarray,
    tau_p: np.ndarray,
    tau_q: np.ndarray,
    attitude: np.ndarray,
    inputs: InputArrays,
) -> bool:
    """Do what `BridgeStage.hear` and `tick` do at `stamp` [ns]; False, and nothing, where they have
    something to decide. time [s]: of the autopilot's cycle."""
    m, port, sequence, rates = a.bridge[0], a.port[0], a.sequence[0], a.rates
    now, hears = stamp / SECOND, port.heartbeat or port.landed
    silent = not hears and now - port.received_at > LINK_GAP
    if silent or now - min(sequence.streamed, port.delivered) > LINK_GAP:
        return False
    thrust = rate_thrust_of_state(tau_p, tau_q, state, a.flat, rates)
    if thrust < 0.0 or not math.isfinite(thrust + rates[0] + rates[1] + rates[2]):
        return False
    begin_poll(a.port, now)
    port.late_to = port.late_from = 0.0
    if hears:
        port.received_at, port.heartbeat, port.landed = now, 0, 0
    follow_thrust(a.hold, now, thrust, attitude[0, 2], True)
    if pose_due(a.vision, now, state, True):
        send_vision(a, time)
    setpoint = a.autopilot.setpoint
    setpoint[0], setpoint[1], setpoint[2] = rates[0], -rates[1], -rates[2]
    setpoint[3] = min(1.0, max(0.0, thrust))
    take_setpoint(a.autopilot.commander, time)
    port.delivered = sequence.streamed = sequence.time = now
    a.sent[0], a.sent[1] = 1.0, thrust
    m.factor = factor = a.map[0].factor
    step = min(max(stamp - m.last, 0) / SECOND, LONGEST_STEP)
    found = measure(
        *(now, step, state, rates, thrust, True, True, factor, a.curve),
        *(a.measured, a.delay_numbers),
    )
    if found != factor:
        use_factor(a.map, a.flat, found)
    m.lift_due = stamp // LIFT_PERIOD != m.last // LIFT_PERIOD
    if m.lift_due:
        inputs.kept[LIFT] = True
        inputs.lift[0] = a.measured.lift[0]
    m.last = stamp
    return True


@borrowing
def reports(a: BridgeArrays) -> bool:
    """Return whether the last tick has a report."""
    return a.bridge[0].last >= a.reports[0].due


@jit
def send_vision(a: BridgeArrays, time: float) -> None:
    """Give the newest pose to the autopilot, as `JoinedAutopilot.send_vision`."""
    pose = a.vision.pose
    position, quaternion = swap_world(pose[:3]), swap_quaternion(pose[3:])
    age = age_by(a.vision.numbers[0].exposed, time)
    take_vision(time, position, quaternion, age, a.autopilot.estimator)


@borrowing
def cycle(a: BridgeArrays, time: float, gyro: np.ndarray, force: np.ndarray) -> bool:
    """Do what `JoinedAutopilot.update` does at `time` [s]; False where it decides.

    gyro (3,) [rad/s], force (3,) [m/s^2]: sample, FLU.
    """
    swap_sample(gyro, force, a.gyro, a.force)
    if not fly_rates(a.autopilot, time, a.gyro, a.force):
        return False
    report(a.port, time)
    return True
