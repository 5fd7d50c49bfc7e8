"""What surrounds the law in a controller, against hand-worked numbers.

The law is ASMC-1 with next to no feedback: tau = Mhat (chi_d_ddot - Lambda e_dot) + Dhat, and
Dhat' = -Gamma s with s = e_dot + Lambda e. Damping and switching are off.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_arm import planar_arm

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.control.output_limits import ArmLimits, AttitudeLimits, PositionLimits
from uam_control.laws.asmc1 import Asmc1Parameters
from uam_control.laws.modular import ModularParameters
from uam_control.profiles.profile import controller_parameters
from uam_control.stages.law_stages import MeasuredDelay

A = math.atan2(0.6, 0.8)  # sine .6, cosine .8
LAW = {
    "inertia": 2.0, "slope": 3.0, "damping": 0.0, "switching": 0.0, "boundary": 1.0,
}  # fmt: skip


def parameters(limits, axes, law=Asmc1Parameters, **values):
    vectors = {name: [value] * axes for name, value in LAW.items()}
    return controller_parameters(law, limits).from_mapping(vectors | {"gamma": 0.0} | values, axes)


def position(**changes):
    values = {
        "gravity_feedforward_mass": 2.0, "gravity": 5.0, "thrust_min": 1.0, "thrust_max": 100.0,
        "tilt_max": 1.4, "attitude_cutoff": 0.5 / math.pi,
    }  # fmt: skip
    return PositionController(parameters(PositionLimits, 3, **values | changes))


def torque(kind, axes, **changes):
    limits = ArmLimits if kind is ArmController else AttitudeLimits
    return kind(parameters(limits, axes, **{"torque_max": [100.0] * axes} | changes))


def vehicle():
    """State, reference and attitude reference, all zero."""
    return np.zeros((3, 8)), np.zeros((3, 8)), np.zeros((3, 3))


def test_force_is_the_law_and_the_weight():
    controller, (state, reference, _) = position(), vehicle()
    np.testing.assert_array_equal(controller.errors, np.zeros((3, 6)))
    state[1, :3], reference[2, :3] = (0.5, -0.5, 1.0), (1.0, 2.0, -1.0)
    tau = controller.update(state, reference, True, 0.004)
    # 2 (1 - 1.5, 2 + 1.5, -1 - 3), and 2*5 N of weight
    np.testing.assert_allclose(tau, [-1.0, 7.0, 2.0])
    assert not controller.saturated
    np.testing.assert_allclose(controller.errors[:, 0], [0.0, 0.5, 1.0])


def test_the_attitude_reference_points_along_the_limited_force_with_the_yaw_of_the_mission():
    controller, (state, reference, _) = position(thrust_max=10.0), vehicle()
    reference[:, 5], reference[2, 0] = (0.0, 0.5, 0.25), 4.0
    state[1, 2] = 10.0 / 15.0  # tau_z is 10 - 2*3*2/3 = 6 N, tau_x 8 N: 10 N in all
    controller.update(state, reference, True, math.log(2.0))
    # omega = 1: the pitch goes from 0 to (1 - (1 + ln 2)/2) of atan(8/6), its rate is ln 2/2 of it
    target, dt = math.atan2(8.0, 6.0), math.log(2.0)
    pitch, rate = target * (1.0 - 0.5 * (1.0 + dt)), target * 0.5 * dt
    np.testing.assert_allclose(controller.attitude_reference[0], [0.0, pitch, 0.0], atol=1e-12)
    expected = [-math.sin(pitch) * 0.5, rate, math.cos(pitch) * 0.5]
    np.testing.assert_allclose(controller.attitude_reference[1], expected)


def test_the_attitude_error_of_xi_is_against_the_reference_of_the_last_tick():
    law = {"lambda_1": 1.0, "lambda_2": 1.0, "lambda_table": 1.0, "q_position": 1.0}
    law |= {"q_velocity": 1.0, "inertia": 1.0}
    values = {name: [value] * 3 for name, value in law.items()}
    values |= {"k_initial": [1e-9, 1.0, 1e-9, 1e-9], "nu": [1.0] * 4, "attitude_cutoff": 100.0}
    values |= {"zeta_initial": 1e-9, "adapt": False, "gravity_feedforward_mass": 1.0}
    kind = controller_parameters(ModularParameters, PositionLimits)
    controller, (state, reference, _) = PositionController(kind.from_mapping(values, 3)), vehicle()
    reference[0, 5] = A
    for expected in (0.0, 0.6):  # e_q is of the level attitude at yaw 0 first, then at yaw A
        controller.update(state, reference, True, 10.0)
        rho = controller.adaptation[controller.names.index("rho")]
        assert rho == pytest.approx(expected, abs=1e-8)  # rho = K1 ||xi||


@pytest.mark.parametrize("frame, adapt", [("world", True), ("heading", True), ("heading", False)])
def test_theta_hat_turns_with_the_heading_where_it_is_asked_for(frame, adapt):
    law = dict.fromkeys(("lambda_1", "lambda_2", "lambda_table", "inertia", "bias_gain"), 1.0)
    values = {name: [value] * 3 for name, value in law.items()}
    values |= {"q_position": [1.0] * 3, "q_velocity": [1.0] * 3, "k_initial": [1.0] * 4}
    values |= {"nu": [1.0] * 4, "bias_frame": frame, "adapt": adapt, "bias_limit": 9.0}
    kind = controller_parameters(ModularParameters, PositionLimits)
    controller, (state, reference, _) = PositionController(kind.from_mapping(values, 3)), vehicle()
    controller.law.bias[:] = 2.0, 1.0, 3.0
    reference[1, 0], reference[1, 5] = 1.0, 5.0 * math.pi  # handed back in flight; 0.1 s: 90 deg
    state[1, 0] = 1.0  # without an error, so that theta_hat only turns
    controller.update(state, reference, True, 0.1)
    turns = frame == "heading" and adapt
    np.testing.assert_allclose(controller.law.bias, [-1.0, 2.0, 3.0] if turns else [2.0, 1.0, 3.0])


def test_on_the_ground_there_is_no_force_and_the_law_starts_afresh():
    controller, (state, reference, _) = position(thrust_max=5.0, gamma=1.0), vehicle()
    state[1, :3], state[0, 5] = 1.0, 0.7
    controller.update(state, reference, True, 0.1)
    assert controller.saturated and controller.adaptation[0] == pytest.approx(-0.2)
    np.testing.assert_array_equal(controller.update(state, reference, False, 0.1), [0.0] * 3)
    np.testing.assert_array_equal(controller.adaptation, 0.0)
    assert not controller.saturated
    np.testing.assert_array_equal(
        controller.attitude_reference, [[0.0, 0.0, 0.7], [0.0] * 3, [0.0] * 3]
    )


@pytest.mark.parametrize("kind", [AttitudeController, ArmController])
def test_torque_is_the_law_within_its_limits(kind):
    axes = 3 if kind is AttitudeController else 2
    controller, (state, reference, desired) = torque(kind, axes), vehicle()
    own = slice(3, 6) if kind is AttitudeController else slice(6, 8)
    state[1, own] = [0.5, -1.0, 0.25][:axes]
    tau = controller.update(state, reference, desired, True, 0.004)
    np.testing.assert_allclose(tau, [-3.0, 6.0, -1.5][:axes])
    assert not controller.saturated
    controller.set_parameters(replace(controller.parameters, torque_max=(2.0,) * axes))
    tau = controller.update(state, reference, desired, True, 0.004)
    np.testing.assert_allclose(tau, [-2.0, 2.0, -1.5][:axes])
    assert controller.saturated


def test_on_the_ground_the_arm_works_and_the_attitude_does_not():
    state, reference, desired = vehicle()
    state[1, 3:] = 1.0
    attitude, arm = torque(AttitudeController, 3, gamma=1.0), torque(ArmController, 2, gamma=1.0)
    for controller in (attitude, arm):
        controller.update(state, reference, desired, True, 0.1)
        assert controller.adaptation[0] == pytest.approx(-0.2)  # -2*1*.1
    np.testing.assert_array_equal(attitude.update(state, reference, desired, False, 0.1), [0.0] * 3)
    np.testing.assert_array_equal(attitude.adaptation, 0.0)
    # -6 of the rate and -.2 of Dhat
    np.testing.assert_allclose(arm.update(state, reference, desired, False, 0.1), [-6.2, -6.2])
    np.testing.assert_array_equal(arm.errors[:, :6], 0.0)


def test_the_law_is_reported_that_the_last_tick_saturated():
    controller, (state, reference, desired) = (
        torque(ArmController, 2, gamma=1.0, torque_max=[1.0, 1.0], freeze_when_saturated=True),
        vehicle(),
    )
    assert not controller.saturated
    state[1, 6:] = 1.0
    controller.update(state, reference, desired, True, 0.1)  # learns, and saturates
    assert controller.saturated
    controller.update(state, reference, desired, True, 0.1)  # keeps what it has
    np.testing.assert_allclose(controller.adaptation[:2], [-0.2, -0.2])
    controller.reset_adaptation()
    np.testing.assert_array_equal(controller.adaptation[:2], 0.0)
    assert controller.saturated  # nothing else changes


def test_the_form_of_the_rate_error_follows_the_parameters():
    state, reference, desired = vehicle()
    state[0, 5], desired[1] = A, (1.0, 0.0, 0.0)
    lee, printed = (
        torque(AttitudeController, 3),
        torque(AttitudeController, 3, error_rate_form="printed"),
    )
    # R^T R_d Omega_d = (.8, -.6, 0); printed R_d^T R Omega_d = (.8, .6, 0); tau = -6 e_dot, and of
    # Lee's form no feedforward, as Omega is 0
    np.testing.assert_allclose(
        lee.update(state, reference, desired, True, 0.1), [4.8, -3.6, 0.0], atol=1e-12
    )
    for _ in range(2):
        np.testing.assert_allclose(
            printed.update(state, reference, desired, True, 0.1), [4.8, 3.6, 0.0], atol=1e-12
        )
        printed.set_parameters(printed.parameters)
    printed.set_parameters(lee.parameters)
    np.testing.assert_allclose(
        printed.update(state, reference, desired, True, 0.1), [4.8, -3.6, 0.0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("rates", "expected"),
    # tau = 2 (chi_d_ddot - 3 e_dot) of roll, e_dot = 1 - desired rate
    [("desired", 2.0 * (8.0 - 3.0 * -3.0)), ("planned", 2.0 * (0.5 - 3.0 * -1.0)), ("none", -6.0)],
)
def test_desired_body_rates_are_those_that_the_parameter_names(rates, expected):
    controller, (state, reference, desired) = (
        torque(AttitudeController, 3, rate_reference=rates),
        vehicle(),
    )
    state[1, 3], reference[1:, 3], desired[1:, 0] = 1.0, (2.0, 0.5), (4.0, 8.0)
    tau = controller.update(state, reference, desired, True, 0.1)
    np.testing.assert_allclose(tau, [expected, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("source", "angle"), [("reference", 0.0), ("state", A)])
def test_the_arm_s_moment_is_that_of_the_angles_that_the_parameter_names(source, angle):
    arm = planar_arm([0.5, 0.0], [0.2, 0.1], [0.4, 0.2]) | {"arm_gravity": 10.0}
    given = {"arm_feedforward": True, "load_from": source, **arm}
    controller, (state, reference, desired) = torque(AttitudeController, 3, **given), vehicle()
    state[0, 6] = A
    tau = controller.update(state, reference, desired, True, 0.004)
    # 0.5 kg at 0.2 m, turned forward by A: the rotors hold up 0.5 10 0.2 sin(A) N m, about -y
    np.testing.assert_allclose(tau, [0.0, -1.0 * math.sin(angle), 0.0], atol=1e-12)


def test_another_corner_of_the_attitude_filter_from_the_next_tick_on():
    slow, fast = position(), position()
    fast.set_parameters(replace(fast.parameters, attitude_cutoff=50.0))
    state, reference, _ = vehicle()
    reference[2, 0] = 4.0
    for controller in (slow, fast):
        controller.update(state, reference, True, 0.1)
    # 8 N forward, 10 N up; the fast filter is there after 31 time constants
    assert fast.attitude_reference[0, 1] == pytest.approx(math.atan2(8.0, 10.0))
    assert slow.attitude_reference[0, 1] < 0.01


@pytest.mark.parametrize(("base", "expected"), [
    ("reference", (0.5 - 0.1 * 3.0, -0.25 + 0.1 * 6.0)),
    ("state", (0.4 - 0.1 * 3.0, -0.25 + 0.1 * 6.0)),
])  # fmt: skip
def test_goal_positions_are_the_torque_times_a_compliance_beside_the_reference(base, expected):
    to_goals = {"setpoint": "position", "goal_from": base, "goal_compliance": 0.1}
    controller = torque(ArmController, 2, **to_goals)
    state, reference, desired = vehicle()
    assert np.isnan(controller.command).all()
    reference[0, 6:], state[0, 6:] = (0.5, -0.25), (0.4, -0.25)
    reference[1, 6:], state[1, 6:] = (0.3, 0.0), (0.8, -1.0)  # tau = -6 (0.5, -1)
    tau = controller.update(state, reference, desired, True, 0.004)
    np.testing.assert_allclose(tau, [-3.0, 6.0])
    np.testing.assert_allclose(controller.command, expected)


def test_goal_positions_stay_until_the_next_period_of_their_rate():
    controller = torque(ArmController, 2, setpoint="position", goal_rate=25.0)
    state, reference, desired = vehicle()
    goals = []
    for tick in range(30):  # of 4 ms, ten to a period
        reference[0, 6:] = tick
        controller.update(state, reference, desired, False, 0.004)
        goals.append(controller.command[0])
    assert goals == [0.0] * 9 + [9.0] * 10 + [19.0] * 10 + [29.0]


def test_the_servos_of_torque_commands_get_the_torque():
    controller, (state, reference, desired) = torque(ArmController, 2), vehicle()
    state[1, 6:] = 0.5
    tau = controller.update(state, reference, desired, True, 0.004)
    np.testing.assert_array_equal(controller.command, tau)
    np.testing.assert_allclose(controller.command, [-3.0, -3.0])


def test_integral_action_by_hand():
    """gain 2, e = 0.5 m for 3 ticks of 0.1 s: 0.3 m/s^2, times the inertia 2 kg; then its limit."""
    controller, (state, reference, _) = position(integral_gain=[2.0, 0.0, 0.0]), vehicle()
    without = position()
    state[0, 0] = 0.5
    for _ in range(3):
        tau = controller.update(state, reference, True, 0.1)[0]
        plain = without.update(state, reference, True, 0.1)[0]
    assert tau - plain == pytest.approx(-2.0 * 0.3)
    controller = position(integral_gain=[2.0, 0.0, 0.0], integral_limit=0.15)
    for _ in range(3):
        tau = controller.update(state, reference, True, 0.1)[0]
    assert tau - plain == pytest.approx(-2.0 * 0.15)
    controller.reset_adaptation()
    tau = controller.update(state, reference, True, 1e-9)[0]
    assert tau == pytest.approx(plain, abs=1e-8)


def test_the_horizontal_force_is_for_the_mass_that_the_integral_holds_up():
    """Weight 10 N at 5 m/s^2; an integral of -0.5 m/s^2 is a mass 10 % larger."""
    controller, (state, reference, _) = position(integral_gain=[0.0, 0.0, 5.0]), vehicle()
    state[0, 2], reference[2, 0] = -1.0, 1.0
    controller.update(state, reference, True, 0.1)
    state[0, 2] = 0.0
    tau = controller.update(state, reference, True, 0.1)
    np.testing.assert_allclose(tau, [2.0 * 1.1, 0.0, 10.0 + 2.0 * 0.5])


def test_drag_is_fed_forward_for_the_desired_velocity():
    controller, (state, reference, _) = position(drag_feedforward=[0.1, 0.0, 0.0]), vehicle()
    reference[1, 0] = state[1, 0] = 3.0
    assert controller.update(state, reference, True, 0.1)[0] == pytest.approx(2.0 * 0.1 * 3.0)


def test_the_autopilot_integrates_the_slow_part_of_the_feedforward():
    """After t = ln 2 / corner, half of a constant Omega_d_dot is left to the autopilot."""
    washed = torque(AttitudeController, 3, feedforward_washout=[2.0, 0.0, 0.0])
    state, reference, attitude = vehicle()
    attitude[2, :2] = 1.0
    tau = washed.update(state, reference, attitude, True, math.log(2.0) / 2.0)
    assert tau[0] == pytest.approx(tau[1] / 2.0)


def test_without_a_weight_the_integral_scales_nothing():
    for mass, factor in ((0.0, 1.0), (0.5, 1.1)):
        changes = {"gravity_feedforward_mass": mass, "thrust_min": 0.1}
        controller = position(integral_gain=[0.0, 0.0, 5.0], **changes)
        state, reference, _ = vehicle()
        state[0, 2], reference[2, 0] = -1.0, 1.0
        controller.update(state, reference, True, 0.1)  # integral -.5, of 5 m/s^2
        state[0, 2] = 0.0
        tau = controller.update(state, reference, True, 0.1)
        np.testing.assert_allclose(tau, [2.0 * factor, 0.0, 5.0 * mass + 1.0])


def test_a_flight_that_begins_in_motion_begins_with_the_attitude_of_the_vehicle():
    """Once: later ticks filter. After the ground it begins anew; at rest it begins level."""
    state, reference, _ = vehicle()
    state[0, 3] = 0.2
    for moving, first in ((3.0, 0.2), (0.0, 0.0)):
        controller = position()
        reference[1, 0] = state[1, 0] = moving
        for _ in range(2):
            controller.update(state, reference, True, 1e-6)
            roll = controller.attitude_reference[0, 0]
            assert roll == pytest.approx(first, abs=1e-6)
            state[0, 3] = 0.5
            controller.update(state, reference, True, 1e-6)
            assert controller.attitude_reference[0, 0] == pytest.approx(roll, abs=1e-5)
            state[0, 3] = 0.2
            controller.update(state, reference, False, 1e-6)


def test_a_vehicle_that_is_handed_back_in_flight_still_carries_what_it_carried():
    """An integral of -0.5 m/s^2 is 1 N of 2 kg, above the weight of 10 N; on the ground it ends."""
    controller, (state, reference, _) = position(integral_gain=[0.0, 0.0, 5.0]), vehicle()
    state[0, 2] = -1.0
    controller.update(state, reference, True, 0.1)
    state[0, 2] = 0.0
    for moving, upward in ((1.0, 11.0), (0.0, 10.0)):
        np.testing.assert_array_equal(controller.update(state, reference, False, 0.1), 0.0)
        reference[1, 0] = state[1, 0] = moving
        assert controller.update(state, reference, True, 0.1)[2] == pytest.approx(upward)


def test_on_the_ground_the_washout_starts_afresh():
    washed = torque(AttitudeController, 3, feedforward_washout=[2.0] * 3)
    state, reference, attitude = vehicle()
    attitude[2] = 1.0
    first = washed.update(state, reference, attitude, True, 0.3).copy()
    washed.update(state, reference, attitude, False, 0.3)
    np.testing.assert_array_equal(washed.update(state, reference, attitude, True, 0.3), first)


def test_the_periods_of_goal_positions_begin_with_the_first_tick():
    controller = torque(ArmController, 2, setpoint="position", goal_rate=2.5)  # 100 ticks
    state, reference, desired = vehicle()
    new = []
    for tick in range(1, 202):
        reference[0, 6:] = tick
        controller.update(state, reference, desired, False, 0.004)
        new.append(controller.command[0] == tick)
    assert [tick for tick, is_new in enumerate(new, 1) if is_new] == [1, 100, 200]


def test_a_prediction_carries_desired_rates_and_errors_of_roll_and_pitch():
    """ASMC-1 with Lambda = 3: tau = 2 (chi_d_ddot - 3 e_dot); the desired rates grow by 4."""
    for ahead, roll in ((0.0, 2.0 * 4.0), (0.1, 2.0 * (4.0 + 3.0 * 0.4))):
        controller = torque(AttitudeController, 3, prediction=ahead)
        state, reference, attitude = vehicle()
        attitude[2] = 4.0
        tau = controller.update(state, reference, attitude, True, 0.004)
        np.testing.assert_allclose(tau, [roll, roll, 8.0])
    controller = torque(AttitudeController, 3, prediction=0.1)
    state, reference, attitude = vehicle()
    state[1, 3:6] = 1.0
    controller.update(state, reference, attitude, True, 0.004)
    np.testing.assert_allclose(controller.errors[0, 3:6], [0.1, 0.1, 0.0])


def test_the_measured_loop_delay_beyond_that_of_the_link_is_predicted():
    controller = torque(
        AttitudeController, 3, prediction=0.01, prediction_measured=True, prediction_nominal=0.007
    )
    delays = MeasuredDelay(controller)
    state, reference, attitude = vehicle()
    state[1, 3] = 1.0

    def ahead(stamp):
        delays.apply(stamp)
        controller.update(state, reference, attitude, True, 0.004)
        return controller.errors[0, 3]

    delays.report(1_000_000_000, 0.027)
    delays.report(2_000_000_000, None)
    assert ahead(1_100_000_000) == pytest.approx(0.01)  # not arrived yet
    assert ahead(1_200_000_000) == pytest.approx(0.03)
    assert ahead(2_200_000_000) == pytest.approx(0.01)  # unknown
    delays.report(3_000_000_000, 1.0)
    assert ahead(4_000_000_000) == pytest.approx(0.1)  # the largest
    delays.report(4_000_000_000, 0.001)
    assert ahead(5_000_000_000) == pytest.approx(0.01)  # less than that of the link
    controller.set_parameters(replace(controller.parameters, prediction_measured=False))
    delays.report(5_000_000_000, 0.027)
    assert ahead(6_000_000_000) == pytest.approx(0.01)


def forward_arm():
    """One link of 1 kg at 1 m, which points forward at rest; gravity 10 m/s^2."""
    values = planar_arm([1.0], [1.0], [1.0])
    state = np.zeros((3, 7))
    state[0, 6] = math.pi / 2.0
    return state, values | {"arm_gravity": 10.0, "arm_feedforward": True}


def test_the_moment_of_the_arm_is_added_to_pitch():
    """-10 N m about y, of each inertia; the washout of ln 2 takes half of it."""
    state, arm = forward_arm()
    for washout, expected in ((0.0, -10.0), (math.log(2.0) / 0.1, -5.0)):
        controller = torque(
            AttitudeController, 3, inertia=[1.0, 2.0, 4.0], feedforward_washout=[washout] * 3, **arm
        )
        tau = controller.update(state, state, np.zeros((3, 3)), True, 0.1)
        np.testing.assert_allclose(tau, [0.0, expected, 0.0], atol=1e-12)


def test_a_law_that_begins_in_flight_leaves_the_moment_of_the_arm_to_the_autopilot():
    """Its integral has the -10 N m already; without them, half is left after ln 2 / corner.

    Without washout the moment is always that of the law.
    """
    for speed, corner, expected in ((0.1, 2.0, (0.0, 5.0)), (0.1, 0.0, (-10.0, 0.0))):
        state, arm = forward_arm()
        hanging = np.zeros((3, 7))
        state[1, 0] = hanging[1, 0] = speed
        controller = torque(AttitudeController, 3, feedforward_washout=[corner] * 3, **arm)
        for _ in range(2):  # once for each flight
            for given, pitch in zip((state, hanging), expected, strict=True):
                step = math.log(2.0) / 2.0
                tau = controller.update(given, given, np.zeros((3, 3)), True, step)
                np.testing.assert_allclose(tau, [0.0, pitch, 0.0], atol=1e-12)
            controller.update(state, state, np.zeros((3, 3)), False, 0.004)


def test_arm_torque_is_law_load_and_integral():
    """10 N m of weight; gain 4, e = 0.5 rad for two ticks of 0.1 s: 0.4 rad/s^2 of 2 kg m^2."""
    reference, arm = forward_arm()
    controller = torque(ArmController, 1, integral_gain=[4.0], **arm)
    state = reference.copy()
    state[0, 6] += 0.5
    # with Lambda = 3 and no gain on s, the law is the feedforward alone, which the load replaces
    reference[2, 6] = 1.0
    for integral in (0.2, 0.4):
        tau = controller.update(state, reference, np.zeros((3, 3)), True, 0.1)
        np.testing.assert_allclose(tau, 10.0 + 1.0 - 2.0 * integral)  # 1 kg m^2 by 1 rad/s^2
    controller.reset_adaptation()
    tau = controller.update(state, reference, np.zeros((3, 3)), True, 1e-9)
    np.testing.assert_allclose(tau, 11.0, atol=1e-6)
