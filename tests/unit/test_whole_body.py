"""Whole-body L1: values by hand, the closed loop on rigid bodies, and what it refuses."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from random_chains import chi_of, in_pinocchio, pin, random_chain

from uam_control.arm.chain import as_parameters
from uam_control.arm.floating import decoupled, stiff, write_task
from uam_control.arm.kinematics import gravity_torque
from uam_control.control import whole_body
from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.control.thrust_direction import write_thrust_attitude
from uam_control.control.whole_body import WholeBody
from uam_control.maths.rotations import matrix_from_euler
from uam_control.profiles.profile import default_profile, load_profile, profile_of
from uam_control.settings.parameter_file import ProfileError
from uam_control.vehicle import load_description

DT, G = 0.004, 9.81
VEHICLE = load_description("t650")
PROFILE = default_profile("whole_body_l1", VEHICLE)  # config/vehicle/t650.yaml names fsc_whole_body
SETS = PROFILE.sets
HOME = np.radians([0.0, 40.0, 40.0, 0.0])


@pytest.fixture(autouse=True)
def in_python(monkeypatch):
    """Run the law's own functions uncompiled: to compile them for these arms takes a minute."""
    for name, function in vars(whole_body).copy().items():
        python = getattr(function, "py_func", None)
        if getattr(python, "__module__", "") == whole_body.__name__:
            monkeypatch.setattr(whole_body, name, python)
    monkeypatch.setattr(whole_body, "bound", lambda step, arrays, *_: partial(step, arrays))


class Flown:
    """The law, and its three controllers, with changed parameters of the arm's section."""

    def __init__(self, position=None, attitude=None, **arm):
        self.position = PositionController(replace(SETS["position_controller"], **position or {}))
        self.attitude = AttitudeController(replace(SETS["attitude_controller"], **attitude or {}))
        self.arm = ArmController(replace(SETS["arm_controller"], **arm))
        self.law = WholeBody(self.position, self.attitude, self.arm)

    def update(self, state, reference):
        """Force, torque and joint torques."""
        self.law.update(state, reference, DT)
        of = self.law.arrays
        return [one.all.tau.copy() for one in (of.position, of.attitude, of.arm)]

    @property
    def chain(self):
        return self.law.arrays.chain


def at_rest(angles=HOME):
    state = np.zeros((3, 6 + len(angles)))
    state[0, 2], state[0, 6:] = 1.2, angles
    return state


def test_at_rest_thrust_is_the_weight_and_the_joints_hold_the_arm():
    flown, state = Flown(), at_rest()
    force, torque, joints = flown.update(state, state)
    np.testing.assert_allclose(force, [0.0, 0.0, 3.746174 * G], atol=1e-5)
    held = np.zeros(4)
    gravity_torque(flown.chain, HOME, (0.0, 0.0, G), held)
    np.testing.assert_allclose(joints, held, atol=1e-5)
    # the thrust acts at the origin, the weight at the centre of mass: moment m g (c_y, -c_x, 0)
    centre = decoupled(flown.chain, HOME).centre
    expected = 3.746174 * G * np.array([centre[1], -centre[0], 0.0])
    np.testing.assert_allclose(torque, expected, atol=1e-5)


def motion(flown, angles, speed=0.1, seed=4):
    """A model of the law's vehicle in Pinocchio, and a state of it that moves: q, v."""
    random, model = np.random.default_rng(seed), in_pinocchio(flown.chain)
    model.armature[6:] = flown.chain.armature
    model.gravity.linear = np.array([0.0, 0.0, -G])
    n = len(angles)
    near = np.append(0.02 * random.normal(size=6), angles)
    near[2] += 1.2
    q = pin.integrate(model, pin.neutral(model), near)
    return model, q, speed * random.normal(size=6 + n)


def accelerated(model, q, v, outputs, wrench=0.0):
    """The acceleration that the outputs of the law make, with a generalised force on top."""
    force, torque, joints = outputs
    turn = pin.Quaternion(q[3:7]).matrix()
    given = np.concatenate([[0.0, 0.0, force @ turn[:, 2]], torque, joints]) + wrench
    return pin.aba(model, model.createData(), q, v, given)


def test_the_hand_and_the_base_accelerate_as_the_law_says():
    """Rigid bodies, moving: y_ddot = y_d_ddot - lambda_1 e_y - lambda_2 e_y_dot, and the same of
    Omega; with a damping of next to nothing, and without friction."""
    free = {"torque_max": (1e3,) * 3}
    flown = Flown(None, free, task_damping=1e-6, arm_feedforward=False, torque_max=(1e3,) * 4)
    model, q, v = motion(flown, np.radians([10.0, 50.0, 30.0, -15.0]))
    state = chi_of(model, q, v, np.zeros(10))
    reference = at_rest(np.radians([5.0, 45.0, 35.0, -10.0]))
    reference[1, 6:], reference[2, 6:] = 0.1, 0.2
    a = accelerated(model, q, v, flown.update(state, reference))
    now, plan = np.zeros((3, 4)), np.zeros((3, 4))
    write_task(flown.chain, chi_of(model, q, v, a), now)
    write_task(flown.chain, reference, plan)
    gains = SETS["arm_controller"]
    error = now - plan
    expected = plan[2] - gains.task_lambda_1 * error[0] - gains.task_lambda_2 * error[1]
    np.testing.assert_allclose(now[2], expected, atol=1e-4)
    e, e_dot, forward = flown.attitude.errors[:, 3:6]
    law = SETS["attitude_controller"]
    expected = forward - np.array(law.lambda_1) * e - np.array(law.lambda_2) * e_dot
    np.testing.assert_allclose(a[3:6], expected, atol=1e-6)


def test_a_constant_force_is_found_in_the_time_of_the_low_pass():
    """Rigid bodies from rest, with a force at the centre of mass: 1 - 1/e of it after
    1 / l1_cutoff."""
    flown, state = Flown(), at_rest()
    model, q, v = motion(flown, HOME, speed=0.0)
    q[:7] = [0, 0, 1.2, 0, 0, 0, 1]
    given = np.array([0.6, -0.4, 0.3])  # N
    wrench = np.zeros(10)
    wrench[:3] = given
    centre = np.array(decoupled(flown.chain, HOME).centre)
    wrench[3:6] = np.cross(centre, given)
    ticks = round(1.0 / 2.927 / DT)
    for _ in range(ticks + 1):
        v = v + DT * accelerated(model, q, v, flown.update(state, at_rest()), wrench)
        q = pin.integrate(model, q, DT * v)
        state = chi_of(model, q, v, np.zeros(10))
    found = flown.position.adaptation[:3]
    np.testing.assert_allclose(found, given * (1.0 - np.exp(-2.927 * ticks * DT)), rtol=0.05)


def test_frozen_it_finds_nothing():
    flown, state = Flown(position={"adapt": False}), at_rest()
    for _ in range(5):
        flown.update(state, at_rest())
        state[1, :6] += 0.01
    assert not flown.position.adaptation.any() and flown.attitude.adaptation.any()


def test_a_joint_that_is_cut_is_missing_at_the_base():
    """tau_q moves by N^T of what the limit takes: the base does not count on it."""
    state, reference = at_rest(), at_rest(HOME + [0.0, 0.3, 0.0, 0.0])
    free = {"torque_max": (1e3,) * 3}
    whole = Flown(None, free, torque_max=(1e3,) * 4)
    cut = Flown(None, free, torque_max=(1e3, 0.5, 1e3, 1e3))
    _, free_q, free = whole.update(state, reference)
    _, torque, joints = cut.update(state, reference)
    assert free[1] > 0.5 and joints[1] == 0.5 and cut.arm.saturated and not whole.arm.saturated
    coupling = decoupled(cut.chain, HOME).coupling
    np.testing.assert_allclose(torque - free_q, coupling.T @ (joints - free), atol=1e-9)


@pytest.mark.parametrize("seed", [1, 6, 7, 11, 13, 23])
def test_any_arm_of_one_to_seven_joints(seed):
    """At rest it holds every random vehicle; beside its reference the outputs are finite."""
    random = np.random.default_rng(seed)
    chain = random_chain(random)
    n = len(chain.masses)
    mass = float(chain.masses.sum() + chain.base_mass)
    arm = dict.fromkeys(("inertia", "lambda_1", "lambda_2", "l1_limit"), (1.0,) * n)
    arm |= {"torque_max": (1e3,) * n, "integral_gain": (0.0,) * n, "joint_load_friction": ()}
    arm |= {k: tuple(v) if isinstance(v, list) else v for k, v in as_parameters(chain).items()}
    weight = {"gravity_feedforward_mass": mass, "thrust_max": 1e3, "inertia": (mass,) * 3}
    flown = Flown(weight, {"torque_max": (1e3,) * 3}, **arm)
    angles = random.uniform(-1.0, 1.0, n)
    force, _, joints = flown.update(at_rest(angles), at_rest(angles))
    held = np.zeros(n)
    gravity_torque(stiff(chain), angles, (0.0, 0.0, G), held)
    np.testing.assert_allclose(force, [0.0, 0.0, mass * G], atol=1e-4)
    np.testing.assert_allclose(joints, held, atol=1e-4)
    state = at_rest(angles) + 0.05 * random.normal(size=(3, 6 + n))
    assert all(np.isfinite(one).all() for one in flown.update(state, at_rest(angles)))
    assert matrix_from_euler(flown.position.attitude_reference[0])[2, 2] > 0.0


def test_one_law_for_some_of_the_controllers_is_refused():
    mixed = {node: dict(section) for node, section in PROFILE.sections.items()}
    mixed["attitude_controller"] = {**mixed["attitude_controller"], "law": "geometric"}
    text = (
        "whole_body_l1 is one law of all three controllers, but attitude_controller has geometric"
    )
    with pytest.raises(ProfileError, match=text):
        profile_of(mixed, Path("own.yaml"), VEHICLE)


def test_the_profile_has_the_published_gains():
    """k_x 50.03, k_v 12.58; k_R 2.134, k_w 1.567 over M_rd; K_y 211.9, 0.2484 and D_y 26.82,
    0.2903 over M_y 1, 0.05."""
    position, attitude, arm = (
        SETS[f"{name}_controller"] for name in ("position", "attitude", "arm")
    )
    turning = np.array([0.145617, 0.139992, 0.143795])
    np.testing.assert_allclose(3.746174 * np.array(position.lambda_1), 50.03, rtol=1e-4)
    np.testing.assert_allclose(3.746174 * np.array(position.lambda_2), 12.58, rtol=1e-4)
    np.testing.assert_allclose(turning * attitude.lambda_1, 2.134, rtol=1e-4)
    np.testing.assert_allclose(turning * attitude.lambda_2, 1.567, rtol=1e-4)
    np.testing.assert_allclose(
        np.array(arm.task_lambda_1) * [1, 1, 1, 0.05], [211.9] * 3 + [0.2484]
    )
    np.testing.assert_allclose(
        np.array(arm.task_lambda_2) * [1, 1, 1, 0.05], [26.82] * 3 + [0.2903]
    )


def test_the_t650_names_single_parameters_beside_the_default_laws():
    """As printed: 12.58 N s/m / 3.746174 kg; the estimator is that of the profile t650."""
    assert PROFILE.section("mavlink_bridge")["setpoint"] == "wrench"
    assert SETS["position_controller"].lambda_2 == (3.3581,) * 3
    assert SETS["state_estimator"].joint_velocity == "observer"
    again = load_profile("fsc_whole_body", vehicle=VEHICLE, onto=PROFILE.sections)
    assert again.sets == SETS


def test_the_attitude_of_a_turning_thrust_has_its_rates():
    """z along f = (2 sin t, cos 2t, 30 + sin t), x as near to the heading 0.3 t + 0.1 t^2."""

    def attitude(t):
        force = (2.0 * np.sin(t), np.cos(2.0 * t), 30.0 + np.sin(t))
        change = (2.0 * np.cos(t), -2.0 * np.sin(2.0 * t), np.cos(t))
        bend = (-2.0 * np.sin(t), -4.0 * np.cos(2.0 * t), -np.sin(t))
        value, heading = np.zeros((3, 3)), np.array([0.3 * t + 0.1 * t**2, 0.3 + 0.2 * t, 0.2])
        write_thrust_attitude(force, change, bend, heading, value)
        return value, matrix_from_euler(value[0]), np.array(force)

    step = 1e-5
    (value, turn, force), before, after = attitude(0.7), attitude(0.7 - step), attitude(0.7 + step)
    np.testing.assert_allclose(turn[:, 2], force / np.linalg.norm(force), atol=1e-12)
    assert turn[:, 1] @ [np.cos(0.259), np.sin(0.259), 0.0] == pytest.approx(0.0, abs=1e-12)
    spin = turn.T @ (after[1] - before[1]) / (2.0 * step)
    np.testing.assert_allclose(value[1], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)
    np.testing.assert_allclose(value[2], (after[0][1] - before[0][1]) / (2.0 * step), atol=1e-8)
