"""The position, attitude and arm controllers, shared by the ROS nodes and the direct engine.

Each controller has one law with its own parameters and adapted gains. From the rest of the vehicle
it uses only ||xi||, ||chi_ddot|| and ||chi_dot||. The parameter `law` selects the law; errors,
limits and weight are the same for all laws. No code here uses ROS.
"""

import math

import numpy as np

from uam_control.arm.still_joint import still_joints
from uam_control.control.around_law import (
    PREDICTION,
    REAL,
    WHOLE,
    ArmArrays,
    AttitudeArrays,
    ControllerArrays,
    PositionArrays,
    RotorLead,
    begin_attitude,
    begin_law,
    end_arm,
    end_attitude,
    end_position,
    let_go,
    predict_by,
)
from uam_control.control.output_limits import (
    HEADING,
    RATE_REFERENCES,
    REFERENCE,
    STATE,
    ArmLimits,
    AttitudeLimits,
    ForceCompletion,
    PositionLimits,
)
from uam_control.control.sample_hold import new_hold
from uam_control.control.thrust_direction import AttitudeReference
from uam_control.coordinates import ALPHA, ARM, ATTITUDE, CHI, CHI_DOT, POSITION, YAW
from uam_control.laws import catalogue
from uam_control.laws.law_parameters import LawParameters
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Flag, record
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import POSITION_SERVO

AT_REST = 1e-4  # [m/s] velocity of the reference in the first ticks of a take-off


class Controller:
    """Base of the three controllers: errors of the whole vehicle, one law, its saturation.

    `errors` (3, 6 + n): rows e, e_dot, chi_d_ddot of the last tick, see `tracking_errors`;
    `saturated`: whether a limit changed the last output; `flying`: whether the law has begun.
    """

    columns: slice
    saturated, flying = Flag(), Flag()

    def __init__(self, parameters: LawParameters) -> None:
        self.law, self.parameters = catalogue.law(parameters.law)(parameters), parameters
        self.names = self.law.names  # of the published gains
        self.adaptation = self.law.adaptation[: len(self.names)]  # the published gains
        self.memory = record(WHOLE, REAL)
        self.errors = np.zeros((3, ALPHA))
        self._norms, axes = np.zeros(3), len(parameters.inertia)
        self._tau, self._integral = np.zeros(axes), np.zeros(axes)
        self.set_parameters(parameters)

    def set_parameters(self, parameters: LawParameters) -> None:
        """See `Law.set_parameters`. Raises ParameterError for the parameters of another law."""
        flying = self.law.parameters.law
        if parameters.law != flying:
            raise ParameterError(f"law: {flying} flies, it cannot change to {parameters.law}")
        self.law.set_parameters(parameters)
        self.parameters = parameters
        self.memory["frozen"] = self.law.frozen
        self.memory["printed"] = parameters.error_rate_form == "printed"
        self._make_arrays()

    def _make_arrays(self) -> None:
        """Make `arrays`, and prepare the functions that use them."""
        self._own = tuple(self.errors[:, self.columns])
        of_all = self.law.arrays.tau, self.errors, self._own, self._norms, self._tau, self.memory
        self.arrays = self._arrays(ControllerArrays(*of_all))  # all that compiled functions use

    def _arrays(self, of_all: ControllerArrays) -> tuple:
        """Return `arrays`; of_all: those of every controller."""
        raise NotImplementedError

    def reset_adaptation(self) -> None:
        """Set the adapted gains to their initial values in flight, bias and integral to zero."""
        self.law.reset_adaptation()
        self._forget()

    def _forget(self) -> None:
        """Set what the vehicle carries to zero."""
        self.law.bias[:] = self._integral[:] = 0.0

    def _fit(self, state: np.ndarray) -> None:
        """Allocate the errors for the shape of `state`, which the first tick tells."""
        if state.shape != self.errors.shape:
            self.errors = np.zeros(state.shape)
            self._make_arrays()

    def enter(self, state: np.ndarray, reference: np.ndarray) -> bool:
        """Note a tick in flight; state, reference: (3, 6 + n), see `coordinates`.

        Returns whether the law begins with it in flight: with the vehicle's velocity, and what the
        vehicle carries, the weight of a payload or the wind. On the ground that is forgotten: the
        reference is at rest, and nearly so if the first tick of a take-off was lost.
        """
        self._fit(state)
        begins, self.flying = not self.flying, True
        moves = bool(np.max(np.abs(reference[CHI_DOT, POSITION])) > AT_REST)
        if begins and not moves:
            self._forget()
        return begins and moves

    def _run_law(self, dt: float) -> None:
        self.law.update(*self._own, self._norms, self.saturated, dt)

    def _idle(self) -> np.ndarray:
        """Reset the law; return its output, zero."""
        self.law.reset()
        self.saturated = self.flying = False
        self._tau[:] = 0.0
        return self._tau


class PositionController(Controller):
    """tau_p, eq. (8), ct1, and the desired attitude, which points the thrust along tau_p."""

    columns = POSITION

    def __init__(self, parameters: PositionLimits) -> None:
        self._attitude = AttitudeReference()
        self.attitude_reference = self._attitude.value  # see `AttitudeReference`
        self._made = np.full(1, math.nan)  # thrust of the rotors, see `RotorLead`
        super().__init__(parameters)

    def _arrays(self, of_all: ControllerArrays) -> PositionArrays:
        p, desired = self.parameters, self._attitude
        mass = p.gravity_feedforward_mass
        completion = ForceCompletion(
            mass * np.array(p.drag_feedforward),
            np.array(p.inertia, dtype=float),
            np.array(p.integral_gain, dtype=float),
            float(p.integral_limit),
            float(p.gravity) if mass > 0.0 else 0.0,
            float(mass * p.gravity),
            float(p.thrust_min),
            float(p.thrust_max),
            float(p.tilt_max),
        )
        filtered = float(p.attitude_cutoff), desired.filter, desired.lead, desired.value
        carried = self.law.bias, self._integral
        rotors = RotorLead(float(p.rotor_lag), float(p.thrust_response), self._made)
        turning = p.bias_frame == HEADING
        arrays = PositionArrays(of_all, completion, carried, rotors, turning, *filtered)
        rows = self.errors
        self._begin = bound(begin_law, of_all, rows, rows, desired.value, True)
        self._end = bound(end_position, arrays, rows, 0.0)
        return arrays

    def update(
        self, state: np.ndarray, reference: np.ndarray, flying: bool, dt: float
    ) -> np.ndarray:
        """Return tau_p (3,) [N, ENU]; while not flying, return zero and reset the law.

        state, reference: (3, 6 + n), see `coordinates`; dt [s]. ||xi|| uses the desired attitude of
        the last tick, because that of this tick follows from tau_p. The next call reuses the array.
        """
        if not flying:
            self._attitude.reset(state[CHI, YAW])
            self._made[:] = math.nan
            return self._idle()
        if self.enter(state, reference):
            self._attitude.begin(state, reference)
        self._begin(state, reference, self.attitude_reference, True)
        self._run_law(dt)
        self._end(reference, dt)
        return self._tau


class AttitudeController(Controller):
    """tau_q (3,) [N m, FLU], eq. (18), ct2.

    The autopilot's rate loop integrates: it adds its integral of the feedforward's effect to
    tau_q. `feedforward_washout` takes this part out of Omega_d_dot beforehand. Where the law begins
    in flight, the autopilot's integral already has all of it.
    """

    columns = ATTITUDE

    def __init__(self, parameters: AttitudeLimits) -> None:
        self._slow = np.zeros(3)  # [rad/s^2] part of the feedforward that the autopilot integrates
        self.prediction = record("counts", PREDICTION)
        self.prediction["measured"] = math.nan
        super().__init__(parameters)

    def _arrays(self, of_all: ControllerArrays) -> AttitudeArrays:
        p, now = self.parameters, self.prediction
        now["counts"], now["nominal"] = p.prediction_measured, p.prediction_nominal
        now["prediction"] = p.prediction
        predict_by(now, now["measured"].item())
        arrays = AttitudeArrays(
            *(of_all, p.load(), np.zeros(3), np.array(p.inertia, dtype=float)),
            *(np.array(p.feedforward_washout, dtype=float), self._slow),
            *(RATE_REFERENCES.index(p.rate_reference), p.load_from == STATE),
            *(np.array(p.torque_max, dtype=float), now),
        )
        rows = self.errors
        self._begin = bound(begin_attitude, arrays, rows, rows, np.zeros((3, 3)), 0.0)
        self._end = bound(end_attitude, arrays)
        return arrays

    def update(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
        dt: float,
    ) -> np.ndarray:
        """Return the torques; while not flying, return zero and reset the law.

        state, reference: (3, 6 + n), see `coordinates`; attitude_reference: (3, 3) of the position
        controller, same tick, see `AttitudeReference.value`; dt [s].
        """
        if not flying:
            self._slow[:] = 0.0
            return self._idle()
        if self.enter(state, reference):
            self._slow[:] = math.nan
        self._begin(state, reference, attitude_reference, dt)
        self._run_law(dt)
        self._end()
        return self._tau


class ArmController(Controller):
    """tau_alpha (n,) [N m], eq. (25), ct3, one torque per joint; it also runs on the ground.

    `command` (n,): what the servos are given, tau_alpha or, with `setpoint: position`, goal
    positions [rad] = reference or state + goal_compliance tau_alpha, renewed at `goal_rate`.
    """

    columns = ARM

    def __init__(self, parameters: ArmLimits) -> None:
        joints = len(parameters.inertia)
        self._hold = new_hold(parameters.goal_rate)
        self._still = still_joints(joints)
        # goals do not exist before the first tick
        to_goals = parameters.setpoint == POSITION_SERVO
        self.command = np.full(joints, np.nan) if to_goals else None
        super().__init__(parameters)

    def _arrays(self, of_all: ControllerArrays) -> ArmArrays:
        p, self._hold["rate"] = self.parameters, self.parameters.goal_rate
        to_goals = p.setpoint == POSITION_SERVO
        if not to_goals:
            self.command = self._tau
        arrays = ArmArrays(
            *(of_all, p.load(), np.array(p.inertia, dtype=float)),
            np.array(p.integral_gain, dtype=float),
            *(float(p.integral_limit), self._integral, np.array(p.torque_max, dtype=float)),
            *(self.command, to_goals, p.goal_from == REFERENCE, float(p.goal_compliance)),
            *(self._hold, self._still),
        )
        rows = self.errors
        self._begin = bound(begin_law, of_all, rows, rows, np.zeros((3, 3)), True)
        self._let_go = bound(let_go, arrays, rows, rows)
        self._end = bound(end_arm, arrays, rows, rows, 0.0)
        return arrays

    @property
    def stuck(self) -> list[int]:
        """The joints, from 1 on, that have no feedback, see `around_law.let_go`."""
        return [i + 1 for i in np.flatnonzero(self._still["stands"])]

    def update(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
        dt: float,
    ) -> np.ndarray:
        """Return the torques and set `command`; the arguments: see `AttitudeController.update`."""
        self._fit(state)
        self._begin(state, reference, attitude_reference, flying)
        if flying:
            self._let_go(state, reference)
        else:
            self._still["angle"] = math.nan
        self._run_law(dt)
        self._end(state, reference, dt)
        return self._tau
