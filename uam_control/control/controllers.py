"""The position, attitude and arm controllers, shared by the ROS nodes and the direct engine.

Each controller has one law with its own parameters and adapted gains. From the rest of the vehicle
it uses only ||xi||, ||chi_ddot|| and ||chi_dot||. The parameter `law` selects the law; errors,
limits and weight are the same for all laws. No code here uses ROS.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.control.around_law import begin_attitude, end_arm, end_position
from uam_control.control.output_limits import (
    LONGEST_PREDICTION,
    ArmLimits,
    AttitudeLimits,
    ForceCompletion,
    PositionLimits,
    TorqueLimits,
    limit_torque,
)
from uam_control.control.sample_hold import SampleHold
from uam_control.control.thrust_direction import AttitudeReference
from uam_control.coordinates import ALPHA, ARM, ATTITUDE, CHI, CHI_DOT, POSITION, YAW
from uam_control.laws import catalogue
from uam_control.laws.errors import E, tracking_errors
from uam_control.laws.law_parameters import LawParameters
from uam_control.maths.compiled import prepared
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import POSITION_SERVO

AT_REST = 1e-4  # [m/s] velocity of the reference in the first ticks of a take-off


class Controller:
    """Base of the three controllers: errors of the whole vehicle, one law, its saturation.

    `adaptation` (len(names),): the law's published gains; `names`: their names.
    `saturated`: whether a limit changed the output of the last tick.
    """

    columns: slice

    def __init__(self, parameters: LawParameters) -> None:
        self.law, self._parameters = catalogue.law(parameters.law)(parameters), parameters
        self.names = self.law.names
        self.adaptation = self.law.adaptation[: len(self.names)]
        self.saturated = self._flying = False
        self._allocate((3, ALPHA))
        self._norms = np.zeros(3)
        rows = self._errors
        self._tracking_errors = prepared(
            tracking_errors, rows, rows, rows, True, True, rows, self._norms
        )

    @property
    def parameters(self) -> LawParameters:
        """The parameters in use."""
        return self._parameters

    def set_parameters(self, parameters: LawParameters) -> None:
        """Use `parameters` (validated) from the next tick on; the adapted gains stay.

        Raises ParameterError if they are the parameters of another law.
        """
        flying = self.law.parameters.law
        if parameters.law != flying:
            raise ParameterError(f"law: {flying} flies, it cannot change to {parameters.law}")
        self.law.set_parameters(parameters)
        self._parameters = parameters
        self._printed = parameters.error_rate_form == "printed"

    def reset_adaptation(self) -> None:
        """Set the adapted gains to their initial values in flight; nothing else changes."""
        self.law.reset_adaptation()

    def _allocate(self, shape: tuple[int, int]) -> None:
        """Allocate the errors for a state of this shape."""
        self._errors = np.zeros(shape)
        self._own = tuple(self._errors[:, self.columns])

    @property
    def errors(self) -> np.ndarray:
        """Rows e, e_dot, chi_d_ddot (3, 6 + n) of the last tick; see `tracking_errors`."""
        return self._errors

    def _track(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
    ) -> None:
        """Write the errors of this tick."""
        self._tracking_errors(
            state, reference, attitude_reference, flying, self._printed, self._errors, self._norms
        )

    def _law_output(self, dt: float) -> np.ndarray:
        return self.law.update(*self._own, self._norms, self.saturated, dt)

    def _begins(self) -> bool:
        """Return whether this is the first tick of the law since `_idle`."""
        begins, self._flying = not self._flying, True
        return begins

    def _idle(self) -> None:
        self.law.reset()
        self.saturated = self._flying = False


class PositionController(Controller):
    """tau_p, eq. (8), ct1, and the desired attitude, which points the thrust along tau_p."""

    columns = POSITION

    def __init__(self, parameters: PositionLimits) -> None:
        super().__init__(parameters)
        self._attitude = AttitudeReference(parameters.attitude_cutoff)
        self._integral = np.zeros(3)  # [m/s^2] integral of integral_gain e
        self._tau = np.zeros(3)
        self.set_parameters(parameters)

    def set_parameters(self, parameters: PositionLimits) -> None:
        """See `Controller.set_parameters`; also sets the corner of the attitude filter."""
        super().set_parameters(parameters)
        p, self._attitude.cutoff = parameters, parameters.attitude_cutoff
        mass = p.gravity_feedforward_mass
        self._completion = ForceCompletion(
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
        desired = self._attitude
        self._end = prepared(
            *(end_position, desired.value, self._integral, self._completion, False, 0.0),
            *(self._integral, self._tau, self._tau, 0.0, desired.filter, desired.lead),
            desired.value,
        )

    @property
    def attitude_reference(self) -> np.ndarray:
        """Rows q_d [rad], Omega_d, Omega_d_dot (3, 3); see `AttitudeReference.value`."""
        return self._attitude.value

    def reset_adaptation(self) -> None:
        """See `Controller.reset_adaptation`; the integral is set to zero, too."""
        super().reset_adaptation()
        self._integral[:] = 0.0

    def update(
        self, state: np.ndarray, reference: np.ndarray, flying: bool, dt: float
    ) -> np.ndarray:
        """Return tau_p (3,) [N, ENU]; while not flying, return zero and reset the law.

        state, reference: (3, 6 + n), see `coordinates`; dt [s]. ||xi|| uses the desired attitude of
        the last tick, because that of this tick follows from tau_p. The next call reuses the array.
        The integral of a vehicle that is handed back in flight is that of its last tick: the weight
        of a payload and the wind are still there.
        """
        if not flying:
            self._idle()
            self._tau[:] = 0.0
            self._attitude.reset(state[CHI, YAW])
            return self._tau
        if self._begins():
            if _in_flight(reference):
                self._attitude.begin(state, reference)
            else:
                self._integral[:] = 0.0
        if state.shape != self._errors.shape:
            self._allocate(state.shape)
        desired = self._attitude
        self._track(state, reference, desired.value, True)
        self.saturated = self._end(
            reference,
            self._own[E],
            self._completion,
            self.saturated,
            dt,
            self._integral,
            self._law_output(dt),
            self._tau,
            desired.cutoff,
            desired.filter,
            desired.lead,
            desired.value,
        )
        return self._tau


class TorqueController(Controller):
    """Base for tau_q and tau_alpha: the law's output within the torque limits."""

    on_ground = False  # whether the law also runs while not flying

    def __init__(self, parameters: TorqueLimits) -> None:
        super().__init__(parameters)
        self._tau = np.zeros(len(parameters.torque_max))

    def set_parameters(self, parameters: TorqueLimits) -> None:
        """See `Controller.set_parameters`."""
        super().set_parameters(parameters)
        self._torque_max = np.array(parameters.torque_max, dtype=float)

    def update(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
        dt: float,
    ) -> np.ndarray:
        """Return the torque (n,) [N m], one per axis of the subsystem.

        While not flying, return zero and reset the law, unless it runs `on_ground`. state,
        reference: (3, 6 + n), see `coordinates`; attitude_reference: (3, 3) of the position
        controller, same tick, see `AttitudeReference.value`; dt [s].
        """
        if not (flying or self.on_ground):
            self._idle()
            self._tau[:] = 0.0
            return self._tau
        if state.shape != self._errors.shape:
            self._allocate(state.shape)
        self._begin(state, reference, attitude_reference, flying, dt)
        self.saturated = self._end(reference, self._law_output(dt), dt)
        return self._tau

    def _begin(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
        dt: float,
    ) -> None:
        """Write the errors of this tick, for the law."""
        self._track(state, reference, attitude_reference, flying)

    def _end(self, reference: np.ndarray, tau: np.ndarray, dt: float) -> bool:
        """Write the law's output tau (n,) within its limits to `_tau`; whether a limit acted."""
        raise NotImplementedError


class AttitudeController(TorqueController):
    """tau_q (3,) [N m, FLU], eq. (18), ct2.

    The autopilot's rate loop integrates: it adds its integral of the feedforward's effect to
    tau_q. `feedforward_washout` takes this part out of Omega_d_dot beforehand. Where the law begins
    in flight, the autopilot's integral already has all of it.
    """

    columns = ATTITUDE

    def __init__(self, parameters: AttitudeLimits) -> None:
        super().__init__(parameters)
        self._measured = math.nan  # [s] loop delay
        self._slow = np.zeros(3)  # [rad/s^2] part of the feedforward that the autopilot integrates
        self._limit = prepared(limit_torque, self._tau, self._tau, self._tau)
        self.set_parameters(parameters)

    def set_parameters(self, parameters: AttitudeLimits) -> None:
        """See `Controller.set_parameters`."""
        super().set_parameters(parameters)
        self._washout = np.array(parameters.feedforward_washout, dtype=float)
        self._arm, self._joints = parameters.load_record(), np.zeros(len(parameters.link_masses))
        rows, axes = self._errors, self._slow
        self._prepare = prepared(
            *(begin_attitude, rows, rows, rows, True, True, self._arm, True, 0.0, 0.0),
            *(axes, 0.0, rows, self._norms, self._joints, axes),
        )
        self.measured(self._measured)

    def measured(self, loop_delay: float) -> None:
        """Use the measured `loop_delay` [s], from a setpoint to the gyro's response; NaN: unknown.

        It counts with `prediction_measured`.
        """
        self._measured, self._ahead = loop_delay, self.ahead(loop_delay)

    def ahead(self, loop_delay: float) -> float:
        """Return the time [s] by which errors are predicted with a measured `loop_delay` [s]."""
        p = self.parameters
        if not (p.prediction_measured and math.isfinite(loop_delay)):
            return p.prediction
        beyond = max(0.0, loop_delay - p.prediction_nominal)
        return min(LONGEST_PREDICTION, p.prediction + beyond)

    def _begin(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
        dt: float,
    ) -> None:
        p = self._parameters
        if self._begins() and _in_flight(reference):
            self._slow[:] = math.nan
        self._prepare(
            state,
            reference,
            attitude_reference,
            flying,
            self._printed,
            self._arm,
            p.arm_feedforward,
            p.inertia[1],
            self._ahead,
            self._washout,
            dt,
            self._errors,
            self._norms,
            self._joints,
            self._slow,
        )

    def _end(self, reference: np.ndarray, tau: np.ndarray, dt: float) -> bool:
        return self._limit(tau, self._torque_max, self._tau)

    def _idle(self) -> None:
        super()._idle()
        self._slow[:] = 0.0


class ArmController(TorqueController):
    """tau_alpha (n,) [N m], eq. (25), ct3, one torque per joint; it also runs on the ground.

    `command` (n,): what the servos are given, tau_alpha or, with `setpoint: position`, goal
    positions [rad] = reference or state + goal_compliance tau_alpha, renewed at `goal_rate`.
    """

    columns = ARM
    on_ground = True

    def __init__(self, parameters: ArmLimits) -> None:
        super().__init__(parameters)
        self._hold, self._time = SampleHold(parameters.goal_rate), 0.0
        self._integral = np.zeros(len(self._tau))  # [rad/s^2] integral of integral_gain e
        self._load = np.zeros(len(self._tau))  # [N m]
        self.set_parameters(parameters)
        to_goals = parameters.setpoint == POSITION_SERVO
        # goals do not exist before the first tick
        self.command = np.full(len(self._tau), np.nan) if to_goals else self._tau

    def set_parameters(self, parameters: ArmLimits) -> None:
        """See `Controller.set_parameters`."""
        super().set_parameters(parameters)
        self._hold.rate = parameters.goal_rate
        self._arm = parameters.load_record()
        n = self._load
        self._complete = prepared(
            *(end_arm, self._errors, self._errors, self._arm, True, n, n, 0.0, n, True, 0.0),
            *(n, n, n, n),
        )
        self._inertia = np.array(parameters.inertia, dtype=float)
        self._integral_gain = np.array(parameters.integral_gain, dtype=float)

    def reset_adaptation(self) -> None:
        """See `Controller.reset_adaptation`; the integral is set to zero, too."""
        super().reset_adaptation()
        self._integral[:] = 0.0

    def _end(self, reference: np.ndarray, tau: np.ndarray, dt: float) -> bool:
        p = self._parameters
        return self._complete(
            reference,
            self._errors,
            self._arm,
            p.arm_feedforward,
            self._inertia,
            self._integral_gain,
            p.integral_limit,
            self._torque_max,
            self.saturated,
            dt,
            self._load,
            self._integral,
            tau,
            self._tau,
        )

    def update(
        self,
        state: np.ndarray,
        reference: np.ndarray,
        attitude_reference: np.ndarray,
        flying: bool,
        dt: float,
    ) -> np.ndarray:
        """See `TorqueController.update`; also sets `command`."""
        tau, p = super().update(state, reference, attitude_reference, flying, dt), self._parameters
        if p.setpoint == POSITION_SERVO:
            self._time += dt
            if self._hold.due(self._time):
                base = reference if p.goal_from == "reference" else state
                self.command[:] = base[CHI, ARM] + p.goal_compliance * tau
        return tau


def _in_flight(reference: np.ndarray) -> bool:
    """Return whether a law begins with a vehicle in flight, which somebody hands back.

    reference (3, 6 + n): then it begins with the vehicle's velocity; on the ground it is at rest,
    and nearly so if the first tick of a take-off was lost.
    """
    return bool(np.max(np.abs(reference[CHI_DOT, POSITION])) > AT_REST)
