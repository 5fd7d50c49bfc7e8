"""Stage: tau_p and tau_q → setpoint of the autopilot; vision, OFFBOARD, arming, thrust factor.

At a tick: `hear` takes what the autopilot sent, then `tick` sends heartbeat and requests, the
newest pose, the setpoint, and compares the thrust with the acceleration. `without` stands in for
`tick` where no commands come.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np

from uam_control.control.sample_hold import is_new, new_hold
from uam_control.coordinates import ATTITUDE, CHI
from uam_control.frames import swap_body
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import Flag, Number, put, record
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import LINK_GAP, OffboardSequence, Phase
from uam_control.setpoints.level_hold import HoldParameters, follow_thrust
from uam_control.setpoints.loop_delay import pause
from uam_control.setpoints.rate_thrust_map import (
    RateThrustMap,
    RateThrustParameters,
    rate_thrust_of_state,
    use_factor,
)
from uam_control.setpoints.setpoint_source import Setpoint, SetpointSource, Situation, sent, silent
from uam_control.setpoints.setpoint_types import SetpointParameters, rates_setpoint
from uam_control.setpoints.targets import AttitudeTarget
from uam_control.setpoints.thrust_identification import ThrustIdentificationParameters
from uam_control.stages.autopilot_port import (
    AutopilotPort,
    AutopilotReport,
    AutopilotReports,
    PortSteps,
)
from uam_control.stages.flight_measurements import (
    FlightMeasurements,
    MeasurementArrays,
    Sent,
    measure,
)
from uam_control.stages.step import ASK, DECIDE, DONE
from uam_control.stages.supervisor_inputs import LIFT, keep
from uam_control.stages.vision_pacing import VisionArrays, VisionPacing, VisionParameters, pose_due
from uam_control.stamps import SECOND
from uam_control.vehicle import VehicleDescription

# The mission's status comes from another process. It counts from a stamp on by which it has arrived
# everywhere, so that a lockstep flight is the same every time.
STATUS_DELAY = 10_000_000  # [ns]


@dataclass(frozen=True)
class BridgeSets:
    """The parameter sets of the stage."""

    mapping: RateThrustParameters
    hold: HoldParameters
    identification: ThrustIdentificationParameters
    vision: VisionParameters
    setpoint: SetpointParameters

    @classmethod
    def of(cls, vehicle: VehicleDescription, section: Mapping[str, Any]) -> Self:
        """Return the sets of a vehicle, overridden by a profile's section mavlink_bridge."""
        return cls(
            RateThrustParameters.of(vehicle, section),
            HoldParameters.among(section),
            ThrustIdentificationParameters.of(vehicle, section),
            VisionParameters.among(section),
            SetpointParameters.among(section),
        )


LIFT_PERIOD = 100_000_000  # [ns] between two reports of thrust factor and lift
LONGEST_STEP = 0.05  # [s] of the low-pass; a longer gap has no setpoints


class BridgeArrays(NamedTuple):
    """State of a `BridgeStage`; memories are (1,)."""

    map: np.ndarray  # memory
    flat: np.ndarray
    rates: np.ndarray  # (3,) [rad/s, FLU] output of the map
    curve: tuple[float, float, float, float]  # of its thrust
    measured: MeasurementArrays
    vision: VisionArrays
    hold: np.ndarray  # memory of the level hold
    sequence: np.ndarray  # memory
    reports: np.ndarray  # memory
    bridge: np.ndarray  # memory
    sent: np.ndarray  # (4,)


class BridgeStage:
    """The bridge between control laws and autopilot. All stamps in [ns].

    `hands`: a person holds the disarmed vehicle and looks at the commands, see docs/preflight.md:
    they are returned, and the autopilot gets none of them.
    `sent` (4,): body rates [rad/s, FLU] and thrust of the last setpoint, see `sent`;
    `lift_due`: whether factor and `lift` are reported; `kept`: the setpoint of the last tick.
    """

    factor, lift_due, last, _compiled = Number(), Flag(), Number(), Flag()

    def __init__(
        self,
        sets: BridgeSets,
        vehicle: VehicleDescription,
        autopilot: AutopilotPort,
        sequence: OffboardSequence,
        fresh: float = math.inf,
        say: Callable[[str, str | None], None] = silent,
        dry_run: bool = False,
    ) -> None:
        """sequence: the one of `autopilot`; fresh, say: see `SetpointSource`; dry_run: setpoints
        are computed and not sent, and nothing is armed."""
        self._dry_run = dry_run
        self.autopilot, self.sequence = autopilot, sequence
        self.map = RateThrustMap(sets.mapping, vehicle)
        self.measurements = FlightMeasurements(sets.identification, vehicle)
        self.identification = self.measurements.identification
        self.loop_delay, self.lift = self.measurements.loop_delay, self.measurements.lift
        self.source = SetpointSource(self.map, sets.hold, sets.setpoint.type, fresh, say)
        self.vision = VisionPacing(sets.vision)
        self._hold, self.kept = new_hold(sets.setpoint.setpoint_rate), None
        self.reports = AutopilotReports(autopilot, sequence, self.loop_delay)
        self._orders: deque[tuple[int, bool, int]] = deque()  # stamp [ns], failsafe, regains
        self._regains = -1  # those of the first status were commanded before this began
        self._situation = Situation(armed=False, landed=True, let_go=False)
        self.report: AutopilotReport | None = None  # of the autopilot, due after the last tick
        self.hands = False
        # last [ns]: stamp of the last tick; compiled: whether compiled ticks were the last ones
        self.memory, self.sent = record("last lift_due compiled", "factor"), np.zeros(4)
        self.factor = 1.0  # thrust factor used for `sent`
        self._note_sent(None)

    def mocap(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Handle a pose: position (3,) [m, ENU], quaternion (4,) [w x y z], FLU → ENU.

        In flight the poses of a frozen tracker are discarded.
        """
        if self.vision.take(stamp / SECOND, position, quaternion, self.autopilot.armed):
            self.source.note_pose(stamp / SECOND, quaternion)

    def arm(self, arm: bool) -> None:
        """Take the mission's desired arming state."""
        self.sequence.set_desired(arm and not self._dry_run)

    def mission(self, stamp: int, magnet: bool, failsafe: bool, regains: int) -> None:
        """Take the mission's status.

        magnet: whether it is on. failsafe: whether the autopilot's failsafe is to act. regains:
        number of commands so far to regain a released vehicle. They count from STATUS_DELAY on.
        """
        self.identification.switch(stamp / SECOND, magnet)
        if self._orders and stamp < self._orders[-1][0]:  # a clock that began anew
            self._orders.clear()
        self._orders.append((stamp, failsafe, regains))

    def note_state(self, stamp: int, state: np.ndarray) -> None:
        """Take an estimate (3, SIZE), also where no tick follows; it is kept, not copied."""
        self.source.note_state(stamp / SECOND, state)

    def hear(self, stamp: int, late: float = 0.0) -> None:
        """Take what the autopilot has sent, and the mission's status that counts by now.

        late [s]: for how long the tick has waited while a process stood still; it gets no setpoint.
        """
        self.autopilot.poll(stamp / SECOND)
        self.sequence.begin(stamp / SECOND, self.autopilot.loss_time, late)
        while self._orders and self._orders[0][0] <= stamp - STATUS_DELAY:
            commanded, self.sequence.let_go, regains = self._orders.popleft()
            if regains > self._regains >= 0:
                self.sequence.regain(commanded / SECOND)
            self._regains = regains
        sequence = self.sequence
        situation = (
            self.autopilot.armed,
            self.autopilot.landed,
            sequence.let_go,
            sequence.released,
            self.autopilot.mode is Mode.OFFBOARD,
            sequence.stopped,
            sequence.withheld,
            sequence.after_loss,
            sequence.phase is Phase.DISARMING,
        )
        if situation != self._situation:
            self._situation = Situation(*situation)

    def tick(
        self,
        stamp: int,
        state: np.ndarray,
        flying: bool,
        tau_p: np.ndarray,
        tau_q: np.ndarray | None,
        attitude: np.ndarray,
        reference: np.ndarray,
    ) -> Setpoint:
        """Send the setpoint of a tick with commands, and return it; None: none was sent.

        Arguments as of `SetpointSource.commanded`; attitude: of the position law, reference: of the
        mission.
        """
        now, situation = stamp / SECOND, self._situation
        setpoint = self.source.commanded(
            now, state, flying, tau_p, tau_q, attitude, situation, reference
        )
        setpoint = self._sampled(now, setpoint, flying)
        rates, thrust = self._note_sent(setpoint)
        self._send(now, setpoint)
        airborne = flying and situation.armed
        self.factor = factor = self.map.thrust_factor
        looped = airborne and setpoint is not None and not self.source.hold.active
        sent = Sent(rates, thrust, looped, airborne and not situation.let_go, factor)
        step = min(max(stamp - self.last, 0) / SECOND, LONGEST_STEP)
        found = self.measurements.update(now, step, state, sent, self.map.curve)
        if found != factor:
            self.map.thrust_factor = found
        self.lift_due = stamp // LIFT_PERIOD != self.last // LIFT_PERIOD
        self.last = stamp
        self.report = self.reports.due(stamp)
        return setpoint

    @property
    def compiled(self) -> bool:
        """Whether its setpoints are of the kind that compiled ticks send: body rates, each tick."""
        rates = self.source.type is rates_setpoint
        return rates and self._hold["rate"].item() <= 0.0 and not self._dry_run

    @property
    def settled(self) -> bool:
        """Whether nothing is to be decided until autopilot, mission or commands change."""
        waits = self._orders or self.hands or self.identification.magnet_waits
        return (
            self._situation == Situation(True, False, False)
            and not waits
            and self.sequence.settled
            and self.reports.settled(self.last)
        )

    def resume(self, stamp: int, state: np.ndarray) -> AutopilotReport | None:
        """Go on after compiled ticks; stamp [ns], state (3, 6 + n): the newest.

        Returns the report that is due after the last of them, None without it or without ticks.
        """
        if not self._compiled:
            return None
        self._compiled = False
        self.note_state(stamp, state)
        self.kept = AttitudeTarget.of_rates(swap_body(self.sent[:3]), self.sent.item(3))
        self.report = self.reports.due(self.last)
        return self.report

    @property
    def arrays(self) -> BridgeArrays:
        """What compiled ticks use."""
        measured, source, mapping = self.measurements, self.source, self.map
        return BridgeArrays(
            *(mapping.memory, mapping.flat, mapping.rates, mapping.curve),
            *(measured.arrays, self.vision.arrays),
            *(source.hold.memory, self.sequence.memory, self.reports.memory),
            *(self.memory, self.sent),
        )

    def _note_sent(self, setpoint: Setpoint) -> tuple[np.ndarray, float]:
        rates, thrust = sent(setpoint)
        self.sent[:3], self.sent[3] = rates, thrust
        return rates, thrust

    def _sampled(self, now: float, setpoint: Setpoint, flying: bool) -> Setpoint:
        """Return the setpoint of the last period at `now` [s] if this one is not due."""
        if not flying or setpoint is None:
            self.kept = None
            return setpoint
        if is_new(self._hold, now) or self.kept is None:
            self.kept = setpoint
        return self.kept

    def without(self, stamp: int) -> Setpoint:
        """Send the setpoint of a tick without valid commands, and return it."""
        now, self.kept = stamp / SECOND, None
        pause(self.loop_delay.sums)
        setpoint = self.source.without(now, self._situation)
        self._note_sent(setpoint)
        self._send(now, setpoint)
        self.report = self.reports.due(stamp)
        self.factor = self.map.thrust_factor
        return setpoint

    def _send(self, now: float, setpoint: Setpoint) -> None:
        """Send the messages due at `now` [s]: heartbeat and requests, vision, setpoint."""
        autopilot = self.autopilot
        if self.hands and not self._situation.armed:
            setpoint = self.source.without(now, self._situation)
        autopilot.tick(now)
        estimate = self.source.estimate(now) if self._situation.armed else None
        self.vision.send(autopilot, now, estimate)
        if setpoint is not None and self.sequence.streaming and not self._dry_run:
            autopilot.send_setpoint(setpoint, now)
            self.sequence.streamed(now)


@cache
def sending(port: PortSteps) -> Callable[[tuple], int]:
    """Return the compiled step of `control_tick.send_setpoint` to a port, in flight with rates."""
    ready, poll, send_vision, send_setpoint = port

    @borrowing
    def send(arrays: tuple) -> int:
        s, a, to, inputs = arrays
        m, sequence, rates, stamp = a.bridge[0], a.sequence[0], a.rates, s.numbers[0].stamp
        now = stamp / SECOND
        if now - sequence.streamed > LINK_GAP or not ready(to, now):
            return DECIDE
        thrust = rate_thrust_of_state(s.tau_p, s.tau_q, s.state, a.flat, rates)
        if thrust < 0.0 or not math.isfinite(thrust + rates[0] + rates[1] + rates[2]):
            return DECIDE
        poll(to, now)
        attitude = s.state[CHI, ATTITUDE]
        follow_thrust(a.hold, now, thrust, s.attitude_reference[0, 2], attitude, True)
        if pose_due(a.vision, now, s.state, True):
            send_vision(to, a.vision.numbers[0].exposed, a.vision.pose)
        send_setpoint(to, now, rates, thrust)
        sequence.streamed = now
        sequence.time = now
        put(rates, a.sent[:3])
        a.sent[3] = thrust
        m.factor = factor = a.map[0].factor
        step = min(max(stamp - m.last, 0) / SECOND, LONGEST_STEP)
        sent = Sent(rates, thrust, True, True, factor)
        found = measure(a.measured, now, step, s.state, sent, a.curve)
        if found != factor:
            use_factor(a.map, a.flat, found)
        if stamp // LIFT_PERIOD != m.last // LIFT_PERIOD:
            keep(inputs, LIFT, stamp, a.measured.lift)
        m.last = stamp
        m.compiled = True
        return DONE

    return send


@borrowing
def unreported(a: tuple) -> int:
    """Return DONE until the last tick has a report; a: `BridgeArrays` alone."""
    (bridge,) = a
    return DONE if bridge.bridge[0].last < bridge.reports[0].next else ASK
