"""Bridge: setpoint to the autopilot, vision poses, measurements; what the autopilot reports."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.ages import FORWARDED, UNAIDED, age_by, usable
from uam_control.estimation.repeats import repeated
from uam_control.frames import swap_body, swap_quaternion, swap_world
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.memory import numbers, put, record
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import LINK_GAP, Phase
from uam_control.setpoints.attitude_target import RATES, UPRIGHT, AttitudeTarget
from uam_control.setpoints.kinds.rates import rates_setpoint
from uam_control.setpoints.level_hold import _THRUST_TIME
from uam_control.setpoints.loop_delay import DelayNumbers
from uam_control.setpoints.rate_thrust_map import _BATTERY, rate_thrust_of_state
from uam_control.setpoints.setpoint_source import Situation
from uam_control.stages.autopilot_report import AutopilotReport
from uam_control.stages.bridge_stage import LIFT_PERIOD, LONGEST_STEP, BridgeStage
from uam_control.stages.flight_measurements import MeasurementArrays, measure
from uam_control.stages.vision_pacing import BEYOND, beyond
from uam_control.stamps import SECOND
from uam_lab.flights.direct.steady.inputs import LIFT, InputArrays
from uam_sim_bridge.autopilot.autopilot_estimator import (
    EstimatorArrays,
    fuse,
)
from uam_sim_bridge.autopilot.commander import STREAM_GAP
from uam_sim_bridge.autopilot.core import magnitude_of_usable
from uam_sim_bridge.autopilot.joined import always, at_once


class BridgeArrays(NamedTuple):
    """State of the bridge and of the link.

    flat: numbers of the map, rates (3,) [rad/s, FLU]: its output, curve: of its thrust. pose (7,):
    waits for the autopilot's estimator, given (7,): as it gets it; newest (7,): the pose before;
    seen (4,): newest attitude. setpoint (4,): of the autopilot, FRD; memory: see WHOLE and REAL.
    """

    flat: np.ndarray
    rates: np.ndarray
    curve: tuple[float, float, float, float]
    measured: MeasurementArrays
    delay_numbers: DelayNumbers
    pose: np.ndarray
    newest: np.ndarray
    given: np.ndarray
    seen: np.ndarray
    setpoint: np.ndarray
    vision: EstimatorArrays
    memory: np.ndarray


WHOLE = "last due reported pose_waits heartbeat landed vision_count"
REAL = (
    "factor used battery sent streamed delivered received_at polled link_period "
    "hold_time hold_thrust hold_yaw "
    "exposed vision_sent vision_interval seen vision_time stream_start stream_last"
)


class BridgePart:
    """The part of a `BridgeStage` with a `JoinedAutopilot`."""

    def __init__(self, bridge: BridgeStage) -> None:
        self._bridge = bridge
        self._pose, self._seen = np.zeros(7), np.zeros(4)
        self.memory = record(WHOLE, REAL)

    def able(self) -> bool:
        """Whether link and setpoint are of the kind whose ticks may be steady."""
        bridge, port = self._bridge, self._bridge.autopilot
        link = (port.passes, port.receives, port.late_to, port.late_from)
        return (
            link == (always, always, at_once, at_once)
            and bridge.source._type is rates_setpoint
            and bridge._hold.rate <= 0.0
            and not bridge._dry_run
        )

    def load(self) -> bool:
        """Copy the state into the arrays; return whether its ticks may be steady."""
        bridge, port, sequence = self._bridge, self._bridge.autopilot, self._bridge.sequence
        source, vision, reports = bridge.source, bridge._vision, bridge._reports
        hold, told, commander = source._hold, port._told, port.autopilot.commander
        what, status = reports.what(bridge._last), port.autopilot.status
        ready = (
            bridge._situation == Situation(True, False, False)
            and not (bridge._orders or bridge.hands or bridge.identification.magnet_waits)
            and not (port._outgoing or port._incoming or port._answers or commander.texts)
            and not (source.holding or hold._thrust is None)
            and told == status == (True, Mode.OFFBOARD, False, port.failsafe, port.intended, False)
            and (port.armed, port.mode, port.landed, port.failsafe, port.killed)
            == (True, Mode.OFFBOARD, False, False, False)
            and port._doubted is None
            and sequence.phase is Phase.FLYING
            and sequence._desired
            and not sequence.stopped
            and sequence._offboard_since is not None
            and reports._reported == what
            and what[0]  # connected
            and math.isfinite(port._period)
        )
        if not ready:
            return False
        waiting = vision._pose
        if waiting is not None:
            self._pose[:3], self._pose[3:] = waiting[1:]
        self._seen[:] = source._seen[1]
        estimator = port.autopilot.estimator
        self.memory[0] = (
            *(bridge._last, reports._due, False, waiting is not None),
            *(port._heartbeat, port._landed, estimator._vision_count),
            *(
                bridge.map.thrust_factor,
                bridge.factor,
                bridge.map.parameters.battery_factor,
                bridge.sent[1],
            ),
            *(sequence._streamed, port._delivered, port._received_at, port._now, port._period),
            *(hold._time, hold._thrust, hold._yaw),
            *(waiting[0] if waiting else 0.0, vision._sent, vision._parameters.vision_interval),
            *(source._seen[0], estimator._vision_time),
            *(commander._stream_start, commander._stream_last),
        )
        return True

    @property
    def due(self) -> int:
        """Stamp [ns] from which on a report of the autopilot is due."""
        return self._bridge._reports._due

    def arrays(self) -> BridgeArrays:
        """Return the arrays."""
        bridge = self._bridge
        measured, autopilot = bridge._measurements, bridge.autopilot.autopilot
        return BridgeArrays(
            bridge.map._flat,
            bridge.map.rates,
            bridge.map.curve,
            measured._arrays,
            measured.loop_delay.numbers,
            self._pose,
            bridge._vision._repeats.newest,
            np.zeros(7),
            self._seen,
            autopilot._setpoint,
            autopilot.estimator._arrays,
            self.memory,
        )

    def report(self) -> AutopilotReport | None:
        """Make the report that was due at the last tick, if any."""
        port, m = self._bridge.autopilot, self.memory
        if not m["reported"].item():
            return None
        port._received_at, port.round_trip = m["received_at"].item(), m["link_period"].item()
        report = self._bridge._reports.due(m["last"].item())
        m["due"], m["reported"] = self.due, False
        return report

    def store(self, state: np.ndarray, estimated: float, sent: bool) -> None:
        """Copy the state back; a report that was due at the last tick is made.

        state (3, 6 + n) of `estimated` [s]; sent: whether a setpoint was sent since `load`.
        """
        bridge, port, sequence = self._bridge, self._bridge.autopilot, self._bridge.sequence
        source, vision, hold = bridge.source, bridge._vision, bridge.source._hold
        m = numbers(self.memory)
        estimator, commander = port.autopilot.estimator, port.autopilot.commander
        vision._sent = m["vision_sent"]
        pose = self._pose.copy()
        vision._pose = (m["exposed"], pose[:3], pose[3:]) if m["pose_waits"] else None
        source._seen = m["seen"], self._seen.copy()
        estimator._vision_time, estimator._vision_count = m["vision_time"], m["vision_count"]
        port._now, port._period = m["polled"], m["link_period"]
        port.round_trip = m["link_period"]
        port._heartbeat, port._landed = bool(m["heartbeat"]), bool(m["landed"])
        port._received_at, port._delivered = m["received_at"], m["delivered"]
        sequence._streamed = m["streamed"]
        hold._time, hold._thrust, hold._yaw = m["hold_time"], m["hold_thrust"], m["hold_yaw"]
        commander._stream_start, commander._stream_last = m["stream_start"], m["stream_last"]
        bridge.map.thrust_factor, bridge.factor = m["factor"], m["used"]
        bridge._last, bridge.lift_due, bridge.report = m["last"], False, self.report()
        if not sent:
            return
        source.note_state(estimated, state)
        sequence._time = m["polled"]
        rates = swap_body(bridge.map.rates)
        target = AttitudeTarget(RATES, UPRIGHT, rates, m["sent"])
        bridge._kept = target
        bridge.sent = target.body_rates, target.thrust


@borrowing
def take_pose(a: BridgeArrays, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> bool:
    """Do what `BridgeStage.mocap` does with a pose of `stamp` [s]; False, and nothing, if it
    repeats the last one."""
    m = a.memory[0]
    if repeated(position, quaternion, a.newest):
        return False
    put(a.newest, a.pose)
    m.pose_waits, m.exposed, m.seen = 1, stamp, stamp
    put(quaternion, a.seen)
    return True


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
    m = a.memory[0]
    now = stamp / SECOND
    received_at = now if m.heartbeat or m.landed else m.received_at
    if now - received_at > LINK_GAP or now - min(m.streamed, m.delivered) > LINK_GAP:
        return False
    thrust = rate_thrust_of_state(tau_p, tau_q, state, a.flat, a.rates)
    rates = a.rates
    if thrust < 0.0 or not math.isfinite(thrust + rates[0] + rates[1] + rates[2]):
        return False
    m.link_period, m.polled = min(m.link_period, now - m.polled), now
    m.received_at, m.heartbeat, m.landed = received_at, 0, 0
    # the level hold's mean thrust
    dt = now - m.hold_time
    m.hold_time, m.hold_yaw = now, attitude[0, 2]
    if 0.0 < dt < _THRUST_TIME:
        m.hold_thrust += dt / _THRUST_TIME * (thrust - m.hold_thrust)
    else:
        m.hold_thrust = thrust
    send_vision(a, now, time, state)
    a.setpoint[0], a.setpoint[1], a.setpoint[2] = rates[0], -rates[1], -rates[2]
    a.setpoint[3] = min(1.0, max(0.0, thrust))
    if time - m.stream_last > STREAM_GAP:
        m.stream_start = time
    m.stream_last, m.delivered, m.streamed, m.sent = time, now, now, thrust
    m.used = factor = m.factor
    step = min(max(stamp - m.last, 0) / SECOND, LONGEST_STEP)
    found = measure(
        *(now, step, state, rates, thrust, True, True, factor, a.curve),
        *(a.measured, a.delay_numbers),
    )
    if found != factor:
        m.factor = found
        a.flat[_BATTERY] = m.battery * found
    if stamp // LIFT_PERIOD != m.last // LIFT_PERIOD:
        inputs.kept[LIFT] = True
        inputs.memory[0].lift_kept = a.measured.lift[0]
    m.last, m.reported = stamp, stamp >= m.due
    return True


@jit
def send_vision(a: BridgeArrays, now: float, time: float, state: np.ndarray) -> None:
    """Give the newest pose to the autopilot's estimator if it is due at `now` [s]; see
    `VisionPacing.send`."""
    m = a.memory[0]
    due = m.exposed - m.vision_sent >= m.vision_interval - 1e-9
    if not m.pose_waits or not usable(now - m.exposed, FORWARDED) or not due:
        return
    m.pose_waits = 0
    if beyond(a.pose[:3], state, now - m.exposed) > BEYOND:
        return
    m.vision_sent = m.exposed
    if not autopilots(a.pose, a.given):
        return
    age = age_by(m.exposed, time)
    if age == math.inf:
        return
    gap, m.vision_time = time - m.vision_time, time
    m.vision_count = 1 if gap > UNAIDED else m.vision_count + 1
    fuse(a.given[:3], a.given[3:], time - age, age, gap, a.vision)


@jit
def autopilots(pose: np.ndarray, given: np.ndarray) -> bool:
    """Write a pose (7,), ENU and FLU, to given (7,), NED and FRD; return whether it is usable."""
    position, quaternion = swap_world(pose[:3]), swap_quaternion(pose[3:])
    norm = magnitude_of_usable(position, quaternion)
    if norm == 0.0:
        return False
    put(position, given[:3])
    put(quaternion / norm, given[3:])
    return True
