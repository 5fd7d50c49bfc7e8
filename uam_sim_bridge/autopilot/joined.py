"""The autopilot stand-in joined to the bridge without messages, for the direct engine.

It has the timing of the MAVLink link: the bridge receives a change of the autopilot's state one
tick later, by the heartbeat sent at once, or by the next regular one if that is lost. Messages may
be delayed further; none overtakes another.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from uam_control.ages import DISCONNECTED, age_by
from uam_control.frames import swap_quaternion, swap_sample, swap_world
from uam_control.maths.compiled import borrowing, jit, prepared
from uam_control.maths.memory import Flag, Number, record
from uam_control.offboard.exchange import Request
from uam_control.offboard.modes import MavResult, Severity
from uam_control.offboard.sequence import LINK_GAP, OffboardSequence
from uam_control.setpoints.targets import RATES as RATES_ALONE
from uam_control.setpoints.targets import AttitudeTarget, Target, VisionPose
from uam_control.stages.autopilot_port import PortSteps
from uam_control.stages.step import DECIDE, DONE
from uam_sim_bridge.autopilot.commander import take_setpoint
from uam_sim_bridge.autopilot.core import Autopilot, AutopilotStatus
from uam_sim_bridge.autopilot.cycle import CycleArrays, fly_rates, take_vision
from uam_sim_bridge.autopilot.late_messages import (
    OTHER,
    POSE,
    RATES,
    LateArrays,
    LateMessages,
    arrives,
    push,
    take,
)
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.faulty_plant import DirectFaults
from uam_sim_bridge.mavlink.link.flight_state import FlightState
from uam_sim_bridge.plant.effects.network_delay import DelayArrays, SetpointDelay, late_at

HEARTBEAT, LANDED = 1.0, 0.2  # [s] between two regular reports, as `telemetry.STREAMS`


class _Received(NamedTuple):
    """Messages of the autopilot; status: of a heartbeat, landed: of its report, None without."""

    answers: list[tuple[Request, MavResult]]
    texts: list[tuple[Severity, str]]
    status: AutopilotStatus | None
    landed: bool | None


# heartbeat, landed: sent, not yet received. [s]: tick of the last `poll`, shortest time between two
# of them, newest message, newest setpoint that reached the autopilot, next regular reports, delays
# of the last poll
WHOLE = "heartbeat landed"
# time [s]: of the autopilot's next cycle
REAL = "now period heard delivered heartbeat_due landed_due late_to late_from time"


class PortArrays(NamedTuple):
    """State of a `JoinedAutopilot`."""

    numbers: np.ndarray  # (1,) see WHOLE, REAL
    autopilot: CycleArrays
    gyro: np.ndarray  # (3,) newest sample, FRD
    force: np.ndarray  # (3,) the same
    network: DelayArrays
    late: LateArrays
    message: np.ndarray  # for one that is sent


class JoinedAutopilot(FlightState):
    """An `AutopilotPort` to the `Autopilot` in the same process.

    `motors` (n,): commands 0..1 of the last cycle; rewritten by the next one. `time` [s]: of the
    autopilot's next cycle, in which messages arrive; set by the owner at each tick.
    """

    _heartbeat, _landed = Flag(), Flag()
    _now, _period, heard, _delivered = (Number() for _ in range(4))
    _heartbeat_due, _landed_due, time = (Number() for _ in range(3))

    def __init__(
        self,
        autopilot: Autopilot,
        sequence: OffboardSequence,
        network: SetpointDelay | None = None,
    ) -> None:
        """sequence: of the bridge; it receives answers and texts; network: of all messages to the
        autopilot, None: without delay."""
        super().__init__()
        self.autopilot, self.sequence = autopilot, sequence
        self.motors = autopilot.motors
        self.memory = record(WHOLE, REAL)
        self.memory[0] = (*(False, False), *(-math.inf, math.inf), *(-math.inf,) * 4, 0.0, 0.0, 0.0)
        self.link = DirectFaults(Schedule())  # its faults
        self.network = network or SetpointDelay(0.0, 0.0, 0.0, 0)
        self._late, self._message = LateMessages(), np.zeros(8)
        self._arrivals = {POSE: self._pose, RATES: self._rates, OTHER: lambda deliver: deliver()}
        self._incoming: deque[tuple[float, _Received]] = deque()
        self._own_sample = np.zeros(3), np.zeros(3)  # gyro, specific force, FRD
        self._swap = prepared(swap_sample, *self._own_sample, *self._own_sample)
        self._report = prepared(report, self.memory, 0.0)
        self._begin_poll = prepared(begin_poll, self.memory, 0.0)
        self._told: AutopilotStatus | None = None
        self._answers: list[tuple[Request, MavResult]] = []

    @property
    def round_trip(self) -> float | None:
        """The time [s] of a message of the last tick to the autopilot, and of its answer."""
        m = self.memory[0]
        known = m.period < math.inf
        return float(m.period + m.late_to + m.late_from) if known else None

    @property
    def steps(self) -> PortSteps | None:
        """See `AutopilotPort`: only of a link that has no faults."""
        usual = type(self) is JoinedAutopilot and type(self.autopilot) is Autopilot
        return None if self.link.timeline.all or not usual else STEPS

    @property
    def arrays(self) -> PortArrays:
        """What compiled ticks use."""
        return PortArrays(
            *(self.memory, self.autopilot.arrays, *self._own_sample),
            *(self.network.arrays, self._late.arrays, self._message),
        )

    @property
    def settled(self) -> bool:
        """Whether the autopilot flies rates in OFFBOARD, and its next reports bring no change."""
        status, told = self.autopilot.status, self._told
        seen = self.armed, self.mode, self.landed, self.failsafe, self.intended, self.killed
        texts = self.autopilot.commander.texts
        waits = self._late.others or self._incoming or self._answers or texts
        return (
            self.autopilot.settled
            and not (waits or self.failsafe)
            and self._doubted is None
            and seen == status == told
            and self._period < math.inf
        )

    @property
    def loss_time(self) -> float:
        """For how long [s] the autopilot stays in OFFBOARD without setpoints; at least LINK_GAP."""
        return max(LINK_GAP, self.autopilot.parameters["COM_OF_LOSS_T"])

    def connected(self, time: float) -> bool:
        """Whether the last message is younger than DISCONNECTED at `time` [s]."""
        return time - self.heard < DISCONNECTED

    def poll(self, time: float) -> None:
        """Deliver delayed messages; receive the autopilot's messages since the last call.

        `round_trip` is that of a message of this tick: its delays, and one tick for the answer. A
        gap between two ticks is no round trip.
        """
        self._begin_poll(self.memory, time)
        late_to, late_from = self._delay(), self.link.late_from()
        self.memory["late_to"], self.memory["late_from"] = late_to, late_from
        self._late.arrive(time, self._arrivals)
        texts = self.autopilot.commander.texts
        if self._answers or texts or self._heartbeat or self._landed:
            self._take(time, late_from, self.autopilot.commander.take_texts())
        while self._incoming and self._incoming[0][0] <= time + 1e-9:
            self._handle(time, self._incoming.popleft()[1])

    def _take(self, time: float, late: float, texts: list[tuple[Severity, str]]) -> None:
        answers, self._answers = self._answers, []
        status = self._told if self._heartbeat else None
        landed = self._told.landed if self._landed else None
        self._heartbeat = self._landed = False
        if self.link.receives():
            self._incoming.append((time + late, _Received(answers, texts, status, landed)))

    def _handle(self, time: float, received: _Received) -> None:
        self.heard = time
        for request, result in received.answers:
            self.sequence.answer(request, result)
        for severity, text in received.texts:
            self.sequence.text(severity, text)
        if received.landed is not None:
            self.landed = received.landed
        status = received.status
        if status is not None:
            self.take_heartbeat(time, status.mode, status.armed)
            self.intended, self.failsafe = status.intended, status.failsafe
            self.killed = status.killed

    def tick(self, time: float) -> None:
        """Send the request of the sequence, if there is one."""
        seen = self.reported(self.connected(time), self._delivered)
        request = self.sequence.update(time, seen)
        if request is not None:
            self._send(OTHER, lambda: self._command(request))

    def send_vision(self, pose: VisionPose) -> None:
        self._send(POSE, np.array([pose.stamp, *pose.position, *pose.quaternion]))

    def send_setpoint(self, target: Target, time: float) -> None:
        """Send the setpoint of the tick `time` [s]."""
        if isinstance(target, AttitudeTarget) and target.type_mask == RATES_ALONE:
            self._send(RATES, np.array([*target.rates, target.thrust]))
        else:
            self._send(OTHER, lambda: self._target(target))

    def _delay(self) -> float:
        """Return the delay [s] of a message that is sent now."""
        return self.link.late_to() + self.network.at(self._now)

    def _send(self, kind: int, content: Any) -> None:
        """Send a message, see `LateMessages.send`: in time for the present cycle if it is not late,
        not at all if the link loses it."""
        if not self.link.passes():
            return
        late = self._delay()
        if late or self._late.count:
            self._late.send(self._now + late, kind, content)
        else:
            self._arrivals[kind](content)

    def _pose(self, values: np.ndarray) -> None:
        position, quaternion = swap_world(values[1:4]), swap_quaternion(values[4:8])
        age = age_by(values.item(0), self.time)
        self.autopilot.vision(self.time, position, quaternion, age)

    def _rates(self, values: np.ndarray) -> None:
        self._target(AttitudeTarget.of_rates(values[:3], values.item(3)))

    def _command(self, request: Request) -> None:
        command, parameters = self.sequence.commands[request]
        self._answers.append((request, self.autopilot.command(self.time, command, parameters)))

    def _target(self, target: Target) -> None:
        self.autopilot.target(self.time, target)
        self._delivered = self._now

    def update(self, time: float, gyro: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Run the autopilot's cycle of `time` [s] and return its motor commands (rotors,), 0..1.

        gyro (3,) [rad/s] and specific force (3,) [m/s^2], FLU: sample of the autopilot's IMU.
        """
        own_gyro, own_force = self._own_sample
        self._swap(gyro, force, own_gyro, own_force)
        motors = self.autopilot.update(time, own_gyro, own_force)
        status = self.autopilot.status
        if status != self._told:
            self._told = status
            self._heartbeat_due = self._landed_due = -math.inf
        self._report(self.memory, time)
        return motors


@borrowing
def begin_poll(port: np.ndarray, time: float) -> None:
    """Begin a tick of the bridge at `time` [s]; port (1,): memory of a `JoinedAutopilot`."""
    m = port[0]
    m.period, m.now = min(m.period, time - m.now), time


@borrowing
def report(port: np.ndarray, time: float) -> None:
    """Send the regular reports that are due at `time` [s]."""
    m = port[0]
    if time >= m.heartbeat_due - 1e-9:
        m.heartbeat = True
        m.heartbeat_due = following(m.heartbeat_due, HEARTBEAT, time)
    if time >= m.landed_due - 1e-9:
        m.landed = True
        m.landed_due = following(m.landed_due, LANDED, time)


@borrowing
def following(due: float, interval: float, time: float) -> float:
    """Return the time [s] of the report after the one due at `due`; as in `Telemetry.due`."""
    return due + interval if due + interval > time else time + interval


@borrowing
def ready(a: PortArrays, now: float) -> bool:
    """See `PortSteps`."""
    m = a.numbers[0]
    silent = not (m.heartbeat or m.landed) and now - m.heard > LINK_GAP
    return not silent and now - m.delivered <= LINK_GAP and a.late.numbers[0].others == 0


@borrowing
def poll(a: PortArrays, now: float) -> None:
    """Do what `JoinedAutopilot.poll` does where no report brings a change."""
    m = a.numbers[0]
    begin_poll(a.numbers, now)
    m.late_to, m.late_from = late_at(a.network, now), 0.0
    while arrives(a.late, now):
        row = take(a.late)
        if a.late.kinds[row] == POSE:
            take_pose(a, a.late.values[row])
        else:
            take_rates(a, a.late.values[row])
    if m.heartbeat or m.landed:
        m.heard, m.heartbeat, m.landed = now, 0, 0


@jit
def take_pose(a: PortArrays, values: np.ndarray) -> None:
    """Deliver a POSE of `late_messages`."""
    time = a.numbers[0].time
    position, quaternion = swap_world(values[1:4]), swap_quaternion(values[4:8])
    take_vision(time, position, quaternion, age_by(values[0], time), a.autopilot.estimator)


@borrowing
def take_rates(a: PortArrays, values: np.ndarray) -> None:
    """Deliver RATES of `late_messages`."""
    m, setpoint = a.numbers[0], a.autopilot.setpoint
    for i in range(3):
        setpoint[i] = values[i]
    setpoint[3] = min(1.0, max(0.0, values[3]))
    take_setpoint(a.autopilot.commander, m.time)
    m.delivered = m.now


@borrowing
def send_vision(a: PortArrays, exposed: float, pose: np.ndarray) -> None:
    """See `PortSteps`."""
    m, values = a.numbers[0], a.message
    values[0] = exposed
    for i in range(7):
        values[1 + i] = pose[i]
    if m.late_to > 0.0 or a.late.numbers[0].count > 0:
        push(a.late, m.now + m.late_to, POSE, values)
    else:
        take_pose(a, values)


@borrowing
def send_setpoint(a: PortArrays, now: float, rates: np.ndarray, thrust: float) -> None:
    """See `PortSteps`."""
    m, values = a.numbers[0], a.message
    values[0], values[1], values[2], values[3] = rates[0], -rates[1], -rates[2], thrust
    if m.late_to > 0.0 or a.late.numbers[0].count > 0:
        push(a.late, now + m.late_to, RATES, values)
    else:
        take_rates(a, values)


STEPS = PortSteps(ready, poll, send_vision, send_setpoint)


@borrowing
def cycle_step(arrays: tuple) -> int:
    """Do what `JoinedAutopilot.update` does with the sample (2, 3), FLU, of the port's time."""
    sample, a = arrays
    time = a.numbers[0].time
    swap_sample(sample[0], sample[1], a.gyro, a.force)
    if not fly_rates(a.autopilot, time, a.gyro, a.force):
        return DECIDE
    report(a.numbers, time)
    return DONE
