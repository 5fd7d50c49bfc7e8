"""Errors on SO(3), limits, the desired attitude, and the modularity of the three."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.control.output_limits import ForceCompletion, limit_force
from uam_control.laws.catalogue import LAWS, label
from uam_control.laws.errors import attitude_errors
from uam_control.maths.rotations import matrix_from_euler
from uam_control.profiles.profile import ProfileError, default_profile, load_profile
from uam_control.settings import configuration
from uam_control.settings.parameter_set import ParameterError

DT = 0.004
angle = st.floats(-0.6, 0.6)


def attitude(state_euler, reference_euler, rate=(0, 0, 0), rate_d=(0, 0, 0), printed=False):
    state, reference, errors = np.zeros((3, 8)), np.zeros((3, 3)), np.zeros((3, 8))
    state[0, 3:6], state[1, 3:6] = state_euler, rate
    reference[0], reference[1] = reference_euler, rate_d
    attitude_errors(state, reference, printed, errors)
    return errors[0, 3:6], errors[1, 3:6]


def test_attitude_error_of_a_pure_rotation_is_its_sine():
    for axis in range(3):
        turn = np.zeros(3)
        turn[axis] = 0.4
        error, _ = attitude(turn, np.zeros(3))
        expected = np.zeros(3)
        expected[axis] = np.sin(0.4)
        np.testing.assert_allclose(error, expected, atol=1e-12)


@given(st.tuples(angle, angle, angle), st.tuples(angle, angle, angle))
def test_attitude_error_is_the_papers_vee_of_the_skew_part(actual, desired):
    error, _ = attitude(actual, desired)
    r, r_d = matrix_from_euler(np.array(actual)), matrix_from_euler(np.array(desired))
    skew = 0.5 * (r_d.T @ r - r.T @ r_d)
    np.testing.assert_allclose(error, [skew[2, 1], skew[0, 2], skew[1, 0]], atol=1e-12)


def test_rate_error_forms_differ_by_about_twice_e_cross_rate():
    rate_d = np.array([0.3, -0.2, 0.5])
    error, lee = attitude((0.02, 0.01, -0.03), np.zeros(3), rate_d=rate_d)
    _, printed = attitude((0.02, 0.01, -0.03), np.zeros(3), rate_d=rate_d, printed=True)
    np.testing.assert_allclose(lee - printed, 2.0 * np.cross(error, rate_d), atol=2e-3)


@given(st.tuples(*[st.floats(-200, 200)] * 3))
def test_limited_force_is_within_thrust_and_tilt(tau):
    out, none = np.zeros(3), np.zeros(3)
    limits = ForceCompletion(none, none, none, 0.0, 0.0, 21.6, 1.0, 36.0, 0.35)
    limit_force(np.array(tau), limits, out)
    assert 1.0 <= out[2] <= 36.0
    assert np.linalg.norm(out) <= 36.0 + 1e-9
    assert np.hypot(out[0], out[1]) <= out[2] * np.tan(0.35) + 1e-9


PROFILES = [law.profile for law in LAWS.values() if law.profile]


def trio(profile="s500"):
    s = (load_profile(profile) if isinstance(profile, str) else profile).sets
    return (
        PositionController(s["position_controller"]),
        AttitudeController(s["attitude_controller"]),
        ArmController(s["arm_controller"]),
    )


def fly(position, other, arm, ticks=200):
    """Feed all three the same made-up motion and return what they did."""
    rng = np.random.default_rng(4)
    reference = np.zeros((3, 8))
    outputs = []
    for _ in range(ticks):
        state = 0.05 * rng.standard_normal((3, 8))
        tau_p = position.update(state, reference, True, DT).copy()
        tau_q = other.update(state, reference, position.attitude_reference, True, DT).copy()
        tau_a = arm.update(state, reference, position.attitude_reference, True, DT).copy()
        outputs.append((tau_p, tau_q, tau_a))
    return outputs


def test_modularity_one_subsystems_gains_leave_the_others_untouched():
    """The paper's claim: other gains for the arm change neither tau_p, tau_q nor their gains."""
    position, other, arm = trio()
    before = fly(position, other, arm)
    gains = position.adaptation.copy(), other.adaptation.copy()
    position, other, arm = trio()
    arm.set_parameters(
        type(arm.parameters).from_mapping(
            {**vars(arm.parameters), "lambda_1": [10.0, 10.0], "nu": [3.0, 3.0, 3.0, 3.0]}, 2
        )
    )
    after = fly(position, other, arm)
    for (p1, q1, _), (p2, q2, _) in zip(before, after, strict=True):
        np.testing.assert_array_equal(p1, p2)
        np.testing.assert_array_equal(q1, q2)
    np.testing.assert_array_equal(gains[0], position.adaptation)
    np.testing.assert_array_equal(gains[1], other.adaptation)
    assert any(not np.array_equal(a[2], b[2]) for a, b in zip(before, after, strict=True))


def test_idle_controllers_give_nothing_and_start_afresh():
    position, other, arm = trio()
    fly(position, other, arm)
    state, reference = np.zeros((3, 8)), np.zeros((3, 8))
    assert not position.update(state, reference, False, DT).any()
    assert not other.update(state, reference, position.attitude_reference, False, DT).any()
    np.testing.assert_array_equal(position.adaptation[:4], position.parameters.k_initial)
    np.testing.assert_array_equal(other.adaptation[:4], other.parameters.k_initial)


def test_gravity_feedforward_carries_the_weight_and_zero_is_the_printed_law():
    state, reference = np.zeros((3, 8)), np.zeros((3, 8))
    position, *_ = trio()
    assert position.update(state, reference, True, DT)[2] == pytest.approx(2.2 * 9.81)
    printed = PositionController(load_profile("paper_table1").sets["position_controller"])
    state[0, 2] = -1.0  # a metre too low: far from lifting 21.6 N
    assert printed.update(state, reference, True, DT)[2] < 8.0


def test_laws_have_labels_and_an_unknown_one_its_name():
    names = ("modular", "asmc1", "asmc2", "pid")
    expected = ["modular", "ASMC-1 (reconstructed)", "ASMC-2 (reconstructed)", "pid"]
    assert [label(name) for name in names] == expected


def test_a_law_with_the_label_of_another_is_called_by_its_name(monkeypatch):
    monkeypatch.setitem(LAWS, "mine", LAWS["asmc1"])
    assert [label("mine"), label("asmc1"), label("asmc2")] == ["mine", "asmc1", LAWS["asmc2"].label]


@pytest.mark.parametrize("law", LAWS)
def test_a_profile_selects_the_law(law):
    profile = default_profile(law)
    assert set(profile.laws().values()) == {law}
    for controller, axes in zip(trio(profile), (3, 3, 2), strict=True):
        assert type(controller.law) is LAWS[law]
        assert len(controller.names) == len(controller.adaptation)
        assert len(controller.law.update(*np.zeros((3, axes)), np.zeros(3), False, DT)) == axes


def test_a_profile_without_law_is_modular_and_an_unknown_law_is_refused(tmp_path):
    assert set(load_profile("paper_table1").laws().values()) == {"modular"}
    file = tmp_path / "other.yaml"
    text = configuration.path("profiles/asmc1.yaml").read_text()
    head, tail = text.split("arm_controller:")
    file.write_text(head + "arm_controller:" + tail.replace("law: asmc1", "law: pid"))
    with pytest.raises(ProfileError, match="arm_controller: law: 'pid' is not one of modular, as"):
        load_profile(str(file))


def test_a_law_without_profile_that_needs_one_is_refused_by_its_name(monkeypatch):
    mine = type("Mine", (LAWS["asmc1"],), {"profile": ""})
    monkeypatch.setitem(LAWS, "asmc1", mine)
    with pytest.raises(ProfileError, match="^law asmc1: position_controller: inertia is missing"):
        default_profile("asmc1")


@pytest.mark.parametrize("law", LAWS)
def test_the_parameters_of_a_controller_survive_pickling(law):
    for node, values in default_profile(law).sets.items():
        again = pickle.loads(pickle.dumps(values))  # noqa: S301 (our own)
        assert again == values and type(again) is type(values), node


@pytest.mark.parametrize("law", ["asmc1", "asmc2"])
def test_the_baselines_have_one_gamma_for_all_subsystems(law):
    profile = load_profile(LAWS[law].profile)
    assert len({profile.sets[node].gamma for node in profile.laws()}) == 1


def test_the_law_cannot_change_while_it_flies_but_its_parameters_can():
    position, *_ = trio("asmc1")
    with pytest.raises(ParameterError, match="law: asmc1 flies, it cannot change to modular"):
        position.set_parameters(trio()[0].parameters)
    position.set_parameters(replace(position.parameters, gamma=7.0, thrust_max=30.0))
    assert position.law.parameters.gamma == 7.0


@pytest.mark.parametrize("profile", PROFILES)
def test_without_adaptation_what_is_adapted_stays(profile):
    adapting, frozen = trio(profile), trio(profile)
    for controller in frozen:
        controller.set_parameters(replace(controller.parameters, adapt=False))
    count = {"s500": [5] * 3, "asmc1": [3, 3, 2], "asmc2": [3] * 3}[profile]
    before = [c.adaptation[:n].copy() for c, n in zip(frozen, count, strict=True)]
    fly(*adapting), fly(*frozen)
    for n, start, moving, still in zip(count, before, adapting, frozen, strict=True):
        np.testing.assert_array_equal(still.adaptation[:n], start)
        assert not np.array_equal(moving.adaptation[:n], start)


@pytest.mark.parametrize("profile", PROFILES)
def test_every_law_is_within_the_same_limits(profile):
    position, other, arm = trio(profile)
    reference = np.zeros((3, 8))
    state = np.full((3, 8), 3.0)
    for _ in range(5):
        tau = position.update(state, reference, True, DT)
        torques = [
            controller.update(state, reference, position.attitude_reference, True, DT)
            for controller in (other, arm)
        ]
        assert np.linalg.norm(tau) <= 36.0 + 1e-9
        for controller, torque in zip((other, arm), torques, strict=True):
            assert np.all(np.abs(torque) <= controller.parameters.torque_max)
    assert position.saturated and other.saturated and arm.saturated
