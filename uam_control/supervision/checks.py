"""Checks of all monitored quantities against their limits.

The monitors run only if a value is near or beyond a limit, or was so recently.

How much later than in the profile's model the setpoints act follows from two measurements, checked
apart. Before take-off `delay_share_of_round_trip` of the round trip counts, as all of it may be on
the way to the autopilot, in flight half of it. In flight the measured loop delay beyond
`delay_nominal` counts, too. The round trip is a clock's difference, the loop delay a fit, for which
it needs `delay_after` of evidence. That is unknown while the vehicle hardly moves, and while
something else moves it. A loop that begins to oscillate moves.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from uam_control.ages import FORWARDED, usable
from uam_control.arm.still_joint import SOON, stands, still_joints
from uam_control.coordinates import ALPHA, CHI, CHI_DOT, ROLL, YAW, X, Z
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Number, record
from uam_control.maths.rotations import tilt, wrapped
from uam_control.supervision.monitor import Level, Monitor
from uam_control.supervision.observation import NUMBERS, Observation, ReadingArrays, Readings
from uam_control.supervision.supervision_parameters import SupervisionLimits, SupervisionParameters

NONE = math.inf
CONTROLLERS, SETPOINT_DELAY, LOOP_DELAY = "controllers", "setpoint delay", "loop delay"
REFERENCE_DELAY = "delay for the reference"
DELAYS = (SETPOINT_DELAY, REFERENCE_DELAY)  # of the link, known before the take-off
POSES_OFF = "motion capture"
CONTRADICTION = "motion capture and IMU"
STUCK = "angle of a joint"
SYMMETRIC = 0.5  # share of the round trip that is on the way to the autopilot, if both are alike


class Check(NamedTuple):
    """A monitored quantity: its name, the text of a cause, and its limits.

    A limit is the name of a parameter, that of a limit [s] that follows from some, or a number.
    """

    name: str
    form: str
    hold: str | float = NONE
    land: str | float = NONE
    failsafe: str | float = NONE
    start: str | float = NONE  # before the take-off, where it is lower than in flight
    in_flight: bool = False  # checked only while airborne
    sign: int = 1  # -1 if a smaller value is worse
    land_after: str = "land_after"  # name of the parameter: time beyond the limit
    failsafe_after: str = "failsafe_after"  # the same
    reading: str = ""  # name of the value in `Readings`
    blind: bool = False  # beyond failsafe it still flies on the IMU for `blind_time`

    @property
    def unit(self) -> str:
        """The unit of the limits, "" for a ratio."""
        named = [limit for limit in (self.hold, self.land) if isinstance(limit, str)]
        specs = SupervisionParameters.specs()
        found = (specs[named[0]].unit if named[0] in specs else "s") if named else ""
        return "" if found == "1" else found


# in the order of the values of `measure` and `read`
CHECKS = (
    Check("estimate", "{name} is not finite", failsafe=0.5),
    Check(
        "position error", "{name} {value:.2f} m exceeds {limit:g} m",
        "position_error_hold", "position_error_land", "position_error_failsafe", in_flight=True,
    ),
    Check("tilt", "{name} {value:.2f} rad exceeds {limit:g} rad", "tilt_hold",
          failsafe="tilt_failsafe"),
    Check("body rate", "{name} {value:.1f} rad/s exceeds {limit:g} rad/s", "body_rate_hold",
          failsafe="body_rate_failsafe"),
    Check("altitude", "{name} {value:.2f} m exceeds {limit:g} m", "altitude_hold", in_flight=True),
    Check("geofence", "{name} left by {value:.2f} m, {limit:g} m allowed",
          land="geofence_land", failsafe="geofence_failsafe"),
    Check("joint angle", "{name} at {value:.2f} of its limit", 1.0),
    Check(POSES_OFF, "{name} is {value:.2f} m off the estimate, {limit:g} m allowed",
          "mocap_distance_hold", failsafe="mocap_distance_hold", in_flight=True,
          failsafe_after="mocap_age_failsafe", blind=True),
    Check("heading error", "{name} {value:.2f} rad exceeds {limit:g} rad", "heading_error_hold",
          in_flight=True),
    Check("battery", "{name} {value:.2f} full, below {limit:g}", land="battery_land", sign=-1,
          reading="battery"),
    Check("mocap", "{name} pose is {value:.2f} s old, {limit:g} s allowed", "mocap_age_hold",
          failsafe="mocap_age_failsafe", start="mocap_age_start", reading="mocap_age", blind=True),
    Check("mocap pose", "{name} has been the same for {value:.2f} s, {limit:g} s allowed",
          "mocap_age_hold", failsafe="mocap_age_failsafe", in_flight=True, reading="mocap_still",
          blind=True),
    Check("joint angles", "{name} are {value:.2f} s old, {limit:g} s allowed", "joint_age_hold",
          reading="joint_age"),
    Check(CONTROLLERS, "a controller's gains are {value:.2f} s old, {limit:g} s allowed",
          "controller_age_hold", reading="controller_age"),
    Check("autopilot", "no message of the {name} for {value:.2f} s, {limit:g} s allowed",
          land="autopilot_age_land", reading="autopilot_age"),
    Check(SETPOINT_DELAY, "{name} {value:.3f} s exceeds {limit:.3g} s of the loops' margin",
          land="setpoint_delay_land", failsafe="setpoint_delay_failsafe"),
    Check("control ticks", "{value:.0f} {name} missed within a second, {limit:g} allowed",
          "missed_ticks_hold", failsafe="missed_ticks_failsafe", reading="missed_ticks"),
    Check("servo temperature", "{name} {value:.0f} deg C exceeds {limit:g} deg C",
          "temperature_hold", "temperature_land", reading="temperature"),
    Check("joint torque", "{name} at {value:.2f} of its limit", 1.0),
    Check("adapted gain", "{name} at {value:.2f} of its limit", 1.0),
    Check(LOOP_DELAY, "measured setpoint delay {value:.3f} s exceeds {limit:.3g} s of the loops' "
          "margin", land="setpoint_delay_land", failsafe="setpoint_delay_failsafe",
          in_flight=True, land_after="delay_after", failsafe_after="delay_after"),
    Check(CONTRADICTION, "{name} contradict each other by {value:.1f} m/s^2, {limit:g} "
          "m/s^2 allowed", failsafe="contradiction_failsafe", in_flight=True,
          reading="contradiction"),
    Check(REFERENCE_DELAY, "setpoint delay {value:.3f} s exceeds {limit:.3g} s that the reference "
          "stands", REFERENCE_DELAY),
    Check("simulation", "the {name} runs {value:.0%} slower than the wall clock, {limit:.0%} "
          "allowed; the autopilot has its own clock", "slower_hold", reading="slower"),
    Check(STUCK, "{name} stays the same while its torque and its reference change", 0.5,
          in_flight=True),
)  # fmt: skip
LATE, LATE_LOOP, LATE_FOR_REFERENCE, EFFORT, GAIN, STILL = (
    [check.name for check in CHECKS].index(it)
    for it in (SETPOINT_DELAY, LOOP_DELAY, REFERENCE_DELAY, "joint torque", "adapted gain", STUCK)
)
BLIND = frozenset(check.name for check in CHECKS if check.blind)
_ROWS = tuple(i for i, check in enumerate(CHECKS) if check.reading)
_SIGNS = tuple(CHECKS[i].sign for i in _ROWS)
_READ = tuple(NUMBERS.index(CHECKS[i].reading) for i in _ROWS)  # places of their readings
_MOCAP_AGE, _ROUND_TRIP, _LOOP_DELAY = map(NUMBERS.index, ("mocap_age", "round_trip", "loop_delay"))


class ExceededLimit(NamedTuple):
    """A limit exceeded for its time: the reaction's level, the cause and the quantity's name.

    Of two quantities at one level one that is not `blind` counts, then the first.
    """

    level: Level
    cause: str
    name: str

    @property
    def blind(self) -> bool:
        """See `Check`."""
        return self.name in BLIND


class CheckArrays(NamedTuple):
    """Limits and values of all quantities."""

    lowest: np.ndarray  # (k,) limit of each; below them no monitor changes while all are quiet
    box: np.ndarray  # (2, 3) [m] low and high corner
    gains: np.ndarray  # (3,) limits of position, attitude, arm
    joints: np.ndarray  # (2, n) limits [rad] to either side of their middle, and the middle
    efforts: np.ndarray  # (n,) limits [N m]
    values: np.ndarray  # (k,) of CHECKS
    still: np.ndarray  # (n,) of `stands`
    numbers: np.ndarray  # (1,) setpoint_delay [s] of `Checks`, delay_nominal [s] and share


class Checks:
    """The monitors of all quantities; `arrays`: what compiled functions use, see `configure`."""

    setpoint_delay = Number()

    def __init__(self, parameters: SupervisionParameters) -> None:
        self._monitors = [Monitor() for _ in CHECKS]
        self.quiet = True  # no value is beyond a limit, not even for a short time
        self._values = np.zeros(len(CHECKS))
        self._still = still_joints(len(parameters.joint_angle_hold))
        self.finding: ExceededLimit | None = None  # the worst one
        self.memory = record("", "setpoint_delay delay_nominal share")
        self.setpoint_delay = math.nan  # [s] of the last tick, NaN if unknown
        self._stands = math.inf
        self.configure(parameters)

    def configure(self, parameters: SupervisionParameters) -> None:
        """Use `parameters` (validated) from the next tick on."""
        p = self._parameters = parameters
        self._limits = tuple(
            tuple(self._limit(check, limit) for limit in (check.hold, check.land, check.failsafe))
            for check in CHECKS
        )
        self._after = tuple(
            (p.hold_after, getattr(p, check.land_after), getattr(p, check.failsafe_after))
            for check in CHECKS
        )
        angles = np.array(p.joint_angle_hold, dtype=float)
        angles = np.stack([angles, np.zeros(len(angles)) + p.joint_angle_middle])
        lowest, box = [min(limits) for limits in self._limits], (p.geofence_low, p.geofence_high)
        limits = (np.array(one, float) for one in (lowest, box, p.gain_hold))
        self.arrays = CheckArrays(
            *limits, angles, np.array(p.joint_effort_hold), self._values, self._still, self.memory
        )
        rows = np.zeros((3, ALPHA))
        self._measure = bound(measure_all, self.arrays, rows, rows, 0.0, Readings().arrays, True)
        self.memory["delay_nominal"] = p.delay_nominal
        self.memory["share"] = p.delay_share_of_round_trip

    @property
    def beyond(self) -> str:
        """The cause of the worst exceeded limit, "" without one."""
        return self.finding.cause if self.finding else ""

    def follow(self, stands: float) -> None:
        """Use a reference that stands a delay of the setpoints of `stands` [s], inf: any."""
        self._stands = stands
        self.configure(self._parameters)

    def _limit(self, check: Check, limit: str | float) -> float:
        if limit == REFERENCE_DELAY:
            return self._stands
        return check.sign * getattr(self._parameters, limit) if isinstance(limit, str) else limit

    def update(self, stamp: float, seen: Observation, in_flight: bool) -> ExceededLimit | None:
        """Check the tick at `stamp` [s]; return the worst exceeded limit, None without one.

        in_flight: whether the vehicle follows the reference.
        """
        readings = seen.readings.arrays
        calm = self._measure(seen.state, seen.reference, seen.ground, readings, in_flight)
        if calm and self.quiet:
            return None
        p, worst = self._parameters, None
        for check, monitor, value, limits, after in zip(
            CHECKS, self._monitors, self._values.tolist(), self._limits, self._after, strict=True
        ):
            if check.in_flight and not in_flight:
                value = -math.inf
            level = monitor.update(stamp, value, limits, after, p.clear_after, p.hysteresis)
            rank = level, not check.blind
            if level and (worst is None or rank > (worst.level, not worst.blind)):
                value, limit = (check.sign * one for one in (monitor.largest, limits[level - 1]))
                cause = check.form.format(name=check.name, value=value, limit=limit)
                worst = ExceededLimit(level, cause, check.name)
        self.quiet = all(monitor.quiet for monitor in self._monitors)
        self.finding = worst
        return worst

    def on_ground(self) -> Iterator[tuple[Check, float, float]]:
        """Yield each check that applies on the ground, with the last value and the lowest limit.

        Value and limit have the sign of the check: larger is worse. An unknown value is -inf.
        """
        for check, value, limits in zip(CHECKS, self._values.tolist(), self._limits, strict=True):
            lowest = min(*limits, self._limit(check, check.start))
            if not check.in_flight and lowest < NONE:
                yield check, value, lowest


@borrowing
def measure_all(
    a: CheckArrays,
    state: np.ndarray,
    reference: np.ndarray,
    ground: float,
    readings: ReadingArrays,
    in_flight: bool,
) -> bool:
    """Write all quantities into the values, in the order of CHECKS; return whether all are calm.

    state, reference (3, 6 + n); ground [m]: height at take-off; in_flight: whether the vehicle
    follows the reference.
    """
    m, values, known = a.numbers[0], a.values, readings.values
    measure(a, state, reference, ground, readings)
    read(a, readings)
    values[STILL] = 0.0
    for i in range(min(state.shape[1] - ALPHA, len(readings.effort), len(a.still))):
        own = state[CHI, ALPHA + i] if in_flight else math.nan
        wanted, torque = reference[CHI, ALPHA + i], readings.effort[i]
        if stands(a.still, i, own, wanted, torque, 0.0, a.efforts[i], SOON):
            values[STILL] = 1.0
    link = by_link(known[_ROUND_TRIP], m.share, in_flight)
    loop = by_loop(known[_LOOP_DELAY], m.delay_nominal, in_flight)
    m.setpoint_delay = larger(link, loop)
    values[LATE], values[LATE_LOOP] = _known(link), _known(loop)
    values[LATE_FOR_REFERENCE] = max(values[LATE], values[LATE_LOOP])
    return _below(values, a.lowest)


@borrowing
def measure(
    a: CheckArrays, state: np.ndarray, reference: np.ndarray, ground: float, readings: ReadingArrays
) -> None:
    """Write the quantities of state and reference into values[:9]; of a state that is not finite
    only values[0]."""
    box, joints, values = a.box, a.joints, a.values
    mocap, age = readings.position, readings.values[_MOCAP_AGE]
    values[0] = 0.0
    for i in range(3):
        for j in range(state.shape[1]):
            if not math.isfinite(state[i, j]):
                values[0] = 1.0
                return
    squared, apart, outside, rate = 0.0, 0.0, -math.inf, 0.0
    for i in range(3):
        position = state[CHI, X + i]
        squared += (position - reference[CHI, X + i]) ** 2
        apart += (position - state[CHI_DOT, X + i] * age - mocap[i]) ** 2
        outside = max(outside, box[0, i] - position, position - box[1, i])
        rate = max(rate, abs(state[CHI_DOT, ROLL + i]))
    values[1] = math.sqrt(squared)
    values[2] = tilt(state[CHI, ROLL:ALPHA])
    values[3] = rate
    values[4] = state[CHI, Z] - ground
    values[5] = outside
    values[6] = -math.inf
    for i in range(min(state.shape[1] - ALPHA, joints.shape[1])):
        values[6] = max(values[6], abs(state[CHI, ALPHA + i] - joints[1, i]) / joints[0, i])
    values[8] = abs(wrapped(state[CHI, YAW] - reference[CHI, YAW]))
    values[7] = math.sqrt(apart) if usable(age, FORWARDED) and not math.isnan(apart) else -math.inf


@borrowing
def read(a: CheckArrays, readings: ReadingArrays) -> None:
    """Write the readings into values[9:]."""
    for i in range(len(_ROWS)):
        a.values[_ROWS[i]] = _known(readings.values[_READ[i]] * _SIGNS[i])
    a.values[EFFORT] = _largest(readings.effort, a.efforts)
    a.values[GAIN] = _largest(readings.gains, a.gains)


@borrowing
def _known(value: float) -> float:
    """Return the value; -inf, which passes every check, for an unknown one (NaN)."""
    return -math.inf if math.isnan(value) else value


@borrowing
def _largest(values: np.ndarray, limits: np.ndarray) -> float:
    """Return the largest |value| / limit; values (n,) without a limit and NaN are ignored."""
    found = -math.inf
    for i in range(min(len(values), len(limits))):
        ratio = abs(values[i]) / limits[i]
        if ratio > found:
            found = ratio
    return found


@borrowing
def _below(values: np.ndarray, limits: np.ndarray) -> bool:
    """Return whether every value (n,) is below its limit (n,); False for a NaN."""
    for i in range(len(limits)):
        if not values[i] < limits[i]:
            return False
    return True


@borrowing
def by_link(round_trip: float, share: float, in_flight: bool) -> float:
    """Return the delay [s] that the round trip [s] shows, NaN if unknown; share: on the ground."""
    return (SYMMETRIC if in_flight else share) * round_trip


@borrowing
def by_loop(loop_delay: float, nominal: float, in_flight: bool) -> float:
    """Return the delay [s] that the loop delay [s] shows, NaN if unknown; it counts in flight."""
    if not in_flight:
        return math.nan
    late = loop_delay - nominal
    return 0.0 if late < 0.0 else late


@borrowing
def larger(link: float, loop: float) -> float:
    """Return the larger of two delays [s]; NaN only if both are unknown."""
    return loop if math.isnan(link) or loop > link else link


def margin_left(delay: float, limits: SupervisionLimits) -> float:
    """Return the share of the margin that is left, below 0 beyond it; NaN for an unknown delay."""
    return 1.0 - delay / limits.delay_margin
