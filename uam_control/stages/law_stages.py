"""Stages: the laws, the ticks at which their gains are published, and the hand's stabilisation."""

import math
from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np

from uam_control.arm.chain import Chain, ChainParameters
from uam_control.arm.hand import freedom
from uam_control.control.around_law import (
    begin_attitude,
    begin_law,
    end_arm,
    end_attitude,
    end_position,
    given,
    let_go,
    predict_by,
)
from uam_control.control.controllers import AttitudeController, Controller
from uam_control.control.hand_steering import (
    IDLE,
    INSIDE,
    REAL,
    TEXTS,
    WHOLE,
    HandArrays,
    HandParameters,
    steer,
)
from uam_control.control.whole_body import WholeBody, WholeBodyArrays
from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Flag, put, record
from uam_control.stages.step import DECIDE, DONE
from uam_control.stages.supervisor_inputs import GAINS, StageArrays, keep
from uam_control.stages.tick_stamps import Timing
from uam_control.stamps import SECOND
from uam_control.vehicle import VehicleDescription, VehicleError, chain_of

REPORT_DELAY = 200_000_000  # [ns] after which a report of a tick has arrived at every stage
MOST_REPORTS = 256  # within that time
GAINS_PERIOD = 20_000_000  # [ns] between two publications of the adapted gains
NEVER = -(2**62)  # [ns] stamp before the first tick
POSITION, ATTITUDE, ARM = range(3)  # numbers in SUBSYSTEMS


class MeasuredDelay:
    """The loop delay that the bridge reports, for the attitude law of a later tick.

    A report is used when it has arrived in every engine, REPORT_DELAY after its stamp.
    """

    def __init__(self, controller: AttitudeController) -> None:
        # count: of the reports that have not arrived, the oldest first; newest [ns]: stamp
        self.memory = record("count newest")
        # stamp [ns] and loop delay [s] of each
        self._reports = record("stamp", "loop_delay", MOST_REPORTS)
        self.arrays = self.memory, self._reports, controller.prediction
        self.apply = partial(prepared(apply_reports, *self.arrays, 0), *self.arrays)

    def report(self, stamp: int, loop_delay: float | None) -> None:
        """Take the report of the tick `stamp` [ns]; loop_delay [s], None: unknown."""
        m = self.memory[0]
        if stamp < m.newest or m.count == MOST_REPORTS:  # a new simulation
            m.count = 0
        self._reports[m.count] = stamp, math.nan if loop_delay is None else loop_delay
        m.count, m.newest = m.count + 1, stamp


@borrowing
def apply_reports(
    delay: np.ndarray, reports: np.ndarray, prediction: np.ndarray, stamp: int
) -> None:
    """Use the newest report that has come by `stamp` [ns]; first three: `MeasuredDelay.arrays`."""
    m, used = delay[0], 0
    while used < m.count and reports[used].stamp <= stamp - REPORT_DELAY:
        predict_by(prediction, reports[used].loop_delay)
        used += 1
    if used:
        m.count -= used
        for i in range(m.count):
            reports[i].stamp = reports[i + used].stamp
            reports[i].loop_delay = reports[i + used].loop_delay


class LawStage:
    """One controller and its time steps.

    `gains_due`: whether to publish the last tick's adapted gains, for recording and supervisor.
    """

    gains_due = Flag()

    def __init__(self, controller: Controller, timing: Timing) -> None:
        self.controller = controller
        # [ns]: control period, stamp of the last tick, begin of its period of the gains
        self.memory = record("gains_due period last begun")
        self.memory[0] = False, timing.period, NEVER, 0
        self.begin = partial(prepared(step_to, self.memory, 0), self.memory)

    def update(self, stamp: int, *inputs: np.ndarray | bool) -> np.ndarray:
        """Return tau at tick `stamp` [ns]; inputs: of the controller's `update`; dt: `step_to`."""
        return self.controller.update(*inputs, self.begin(stamp))


@borrowing
def step_to(stage: np.ndarray, stamp: int) -> float:
    """Return the time [s] since the last tick, at the tick `stamp` [ns]; stage (1,): memory.

    One control period at the first tick, after a gap of more than ten periods and after a step
    back in time: the laws must not integrate over a time without samples.
    """
    m = stage[0]
    step, m.last = stamp - m.last, stamp
    m.gains_due = not m.begun <= stamp < m.begun + GAINS_PERIOD
    if m.gains_due:
        m.begun = stamp // GAINS_PERIOD * GAINS_PERIOD
    if not 0 < step <= 10 * m.period:
        step = m.period
    return step / SECOND


@cache
def position_step(law: Callable) -> Callable[[tuple], int]:
    """Return the compiled step of `control_tick.control_position` with the step of a law."""

    @borrowing
    def control(a: tuple) -> int:
        s, p, own, stage, inputs = a
        if not p.all.numbers[0].flying:
            return DECIDE
        dt = step_to(stage, s.numbers[0].stamp)
        begin_law(p.all, s.state, s.reference, p.attitude, True)
        law(own.record, given(p.all, dt), own.adaptation, own.tau)
        end_position(p, s.reference, dt)
        for row in range(3):
            put(p.attitude[row], s.attitude_reference[row])
        keep_gains(stage, inputs, POSITION, s.numbers[0].stamp, own.adaptation)
        return DONE

    return control


@cache
def attitude_step(law: Callable) -> Callable[[tuple], int]:
    """Return the compiled step of `control_tick.control_attitude` with the step of a law."""

    @borrowing
    def control(a: tuple) -> int:
        s, q, own, stage, inputs, delay, reports, prediction = a
        if not q.all.numbers[0].flying:
            return DECIDE
        stamp = s.numbers[0].stamp
        apply_reports(delay, reports, prediction, stamp)
        dt = step_to(stage, stamp)
        begin_attitude(q, s.state, s.reference, s.attitude_reference, dt)
        law(own.record, given(q.all, dt), own.adaptation, own.tau)
        end_attitude(q)
        keep_gains(stage, inputs, ATTITUDE, stamp, own.adaptation)
        return DONE

    return control


@cache
def arm_step(law: Callable) -> Callable[[tuple], int]:
    """Return the compiled step of `control_tick.control_arm`, in flight, with the step of a law."""

    @borrowing
    def control(a: tuple) -> int:
        s, r, own, stage, inputs, reference = a
        dt = step_to(stage, s.numbers[0].stamp)
        begin_law(r.all, s.state, reference, s.attitude_reference, True)
        let_go(r, s.state, reference)
        law(own.record, given(r.all, dt), own.adaptation, own.tau)
        end_arm(r, s.state, reference, dt)
        keep_gains(stage, inputs, ARM, s.numbers[0].stamp, own.adaptation)
        return DONE

    return control


class WholeBodyStage:
    """The stages of position, attitude and arm in flight, of one law: `stages`, in this order."""

    def __init__(self, stages: Sequence[LawStage]) -> None:
        self.stages = tuple(stages)
        self._law = WholeBody(*(one.controller for one in stages))

    @property
    def arrays(self) -> tuple[WholeBodyArrays, tuple[np.ndarray, ...]]:
        """What the compiled step uses: of the law, and memories of the stages."""
        return self._law.arrays, tuple(one.memory for one in self.stages)

    def update(self, stamp: int, state: np.ndarray, reference: np.ndarray) -> None:
        """Compute the outputs of all controllers at the tick `stamp` [ns]; see `WholeBody`."""
        steps = [one.begin(stamp) for one in self.stages]
        self._law.update(state, reference, steps[POSITION])


class WholeBodyPart:
    """What a node has of a `WholeBodyStage` in place of its stage; the first one computes it."""

    def __init__(self, whole: WholeBodyStage, number: int) -> None:
        """number: of the node's own stage."""
        self._whole, self._own, self._first = whole, whole.stages[number], number == 0

    @property
    def gains_due(self) -> bool:
        """See `LawStage`."""
        return self._own.gains_due

    def update(self, stamp: int, *inputs: np.ndarray | bool) -> np.ndarray:
        """See `LawStage.update`; state, reference and flying count."""
        if not inputs[-1]:
            return self._own.update(stamp, *inputs)
        if self._first:
            self._whole.update(stamp, *inputs[:2])
        return self._own.controller.arrays.all.tau


@cache
def whole_body_step(law: Callable) -> Callable[[tuple], int]:
    """Return the compiled step of `control_tick.control_whole_body` with a law of all three."""

    @borrowing
    def control(a: tuple) -> int:
        s, (w, stages), inputs = a
        flying, (p, q, r) = w.position.all.numbers[0].flying, w.laws
        if not (flying and w.attitude.all.numbers[0].flying):
            return DECIDE
        stamp = s.numbers[0].stamp
        dt = step_to(stages[POSITION], stamp)
        step_to(stages[ATTITUDE], stamp)
        step_to(stages[ARM], stamp)
        law(w, s.state, s.reference, dt)
        for row in range(3):
            put(w.position.attitude[row], s.attitude_reference[row])
        keep_gains(stages[POSITION], inputs, POSITION, stamp, p.adaptation)
        keep_gains(stages[ATTITUDE], inputs, ATTITUDE, stamp, q.adaptation)
        keep_gains(stages[ARM], inputs, ARM, stamp, r.adaptation)
        return DONE

    return control


@borrowing
def keep_gains(
    stage: np.ndarray, inputs: StageArrays, law: int, stamp: int, gains: np.ndarray
) -> None:
    """Keep the gains of a law, by its number in SUBSYSTEMS, for the supervisor if they are due."""
    if stage[0].gains_due:
        keep(inputs, GAINS + law, stamp, gains)


class HandStage:
    """Stabilisation of the hand: corrects the reference of the arm law."""

    def __init__(
        self,
        parameters: HandParameters,
        period: float,
        joints: int,
        vehicle: VehicleDescription | None,
    ) -> None:
        """period [s] of a tick; joints: of the arm; vehicle: without one there is no hand."""
        chain, ranges = _arm(vehicle)
        numbers = record(WHOLE, REAL)
        numbers["has_hand"], numbers["period"], numbers["why"] = chain.has_hand, period, IDLE
        numbers["freedom"] = freedom(chain) if chain.has_hand else 0
        size = 6 + joints
        self.arrays = HandArrays(
            *(chain, ranges, np.zeros((2, joints)), np.zeros(size), np.zeros((6, joints))),
            *(np.zeros((3, size)), numbers),
        )
        rows = self.arrays.reference
        self._steer = bound(steer, self.arrays, rows, rows, True, True)
        self.configure(parameters)

    @property
    def steers(self) -> bool:
        """Whether the arm stabilises a hand in flight."""
        numbers = self.arrays.numbers[0]
        return bool(numbers.has_hand != 0 and numbers.hand_bandwidth > 0.0)

    def configure(self, parameters: HandParameters) -> None:
        """Use `parameters` (validated) from the next tick on."""
        for name in HandParameters.specs():
            self.arrays.numbers[name] = getattr(parameters, name)

    def update(
        self, state: np.ndarray, reference: np.ndarray, flying: bool, saturated: bool
    ) -> np.ndarray:
        """Return the reference (3, 6 + n) of the arm law; see `steer`."""
        self._steer(state, reference, flying, saturated)
        return self.arrays.reference

    @property
    def fades(self) -> str:
        """Why the correction fades out, "" while it acts, or if there is none."""
        one = self.arrays.numbers[0]
        return TEXTS[int(one["why"])] if one["has_hand"] and one["hand_bandwidth"] else ""


def _arm(vehicle: VehicleDescription | None) -> tuple[Chain, np.ndarray]:
    """Return the arm and the ranges of its joints (2, n) [rad], a margin inside."""
    try:
        chain = chain_of(vehicle) if vehicle is not None else ChainParameters().chain()
    except VehicleError:
        chain = ChainParameters().chain()
    joints = () if vehicle is None else vehicle.joints
    ranges = np.array([[one.low + INSIDE, one.high - INSIDE] for one in joints]).reshape(-1, 2)
    return chain, np.ascontiguousarray(ranges.T)


@borrowing
def hand_step(a: tuple) -> int:
    """Do what `HandStage.update` does, in flight."""
    s, h, law = a
    steer(h, s.state, s.reference, True, law[0].saturated != 0)
    return DONE
