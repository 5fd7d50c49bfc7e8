"""New parameters and reset of the adaptation in flight: changed and unchanged variables."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from uam_control.control.controllers import AttitudeController, PositionController
from uam_control.laws.catalogue import LAWS
from uam_control.profiles.profile import default_profile, load_profile
from uam_control.settings.parameter_set import ParameterError

DT = 0.004


def flown(controller, ticks=200):
    """Return a controller after some ticks with a tracking error, and its last state."""
    state, reference = np.zeros((3, 8)), np.zeros((3, 8))
    for tick in range(ticks):
        state[0] = 0.05 * np.sin(0.01 * tick + np.arange(8))
        state[1] = 0.1 * np.cos(0.01 * tick + np.arange(8))
        update(controller, state, reference)
    return state, reference


def update(controller, state, reference):
    if isinstance(controller, PositionController):
        return controller.update(state, reference, True, DT).copy()
    return controller.update(state, reference, np.zeros((3, 3)), True, DT).copy()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("node", ["position_controller", "attitude_controller"])
def test_new_gains_meet_the_old_adaptation_and_the_output_moves_by_the_gains_alone(law, node):
    parameters = default_profile(law).sets[node]
    kind = PositionController if node == "position_controller" else AttitudeController
    controller = kind(parameters)
    state, reference = flown(controller)
    same, changed = deepcopy(controller), deepcopy(controller)
    same.set_parameters(parameters)
    new = replace(parameters, inertia=tuple(1.1 * x for x in parameters.inertia)).validated(3)
    changed.set_parameters(new)
    np.testing.assert_array_equal(changed.adaptation, controller.adaptation)

    before = update(controller, state, reference)
    np.testing.assert_array_equal(update(same, state, reference), before)
    after = update(changed, state, reference)
    if law not in ("asmc1", "indi"):  # Dhat, tau_f are part of tau and not multiplied by Mhat
        weight = getattr(new, "gravity_feedforward_mass", 0.0) * 9.81 * np.array([0, 0, 1.0])
        np.testing.assert_allclose(after - weight, 1.1 * (before - weight), rtol=1e-9, atol=1e-9)
    assert not np.array_equal(after, before)


@pytest.mark.parametrize(("law", "gains"), [("modular", 5), ("asmc1", 3), ("asmc2", 3)])
def test_a_reset_of_the_adaptation_leaves_filters_and_time_alone(law, gains):
    parameters = default_profile(law).sets["attitude_controller"]
    controller = AttitudeController(parameters)
    initial = controller.law.adaptation.copy()
    flown(controller)
    before = controller.law.adaptation.copy()
    controller.reset_adaptation()
    after = controller.law.adaptation
    np.testing.assert_array_equal(after[:gains], initial[:gains])
    np.testing.assert_array_equal(after[gains:], before[gains:])
    assert not np.array_equal(before[:gains], initial[:gains])


@pytest.mark.parametrize("law", ["geometric_l1", "indi"])
def test_a_reset_of_a_law_with_a_predictor_begins_anew(law):
    controller = AttitudeController(default_profile(law).sets["attitude_controller"])
    initial = controller.law.adaptation.copy()
    flown(controller)
    assert not np.array_equal(controller.law.adaptation, initial)
    controller.reset_adaptation()
    np.testing.assert_array_equal(controller.law.adaptation, initial)


def test_inconsistent_values_are_refused():
    position = load_profile("s500").sets["position_controller"]
    with pytest.raises(ParameterError, match="thrust_min: 37 N is above thrust_max, 36 N"):
        replace(position, thrust_min=37.0).validated(3)
    flat = {"lambda_1": (1e-9,) * 3, "lambda_2": (1e6,) * 3, "q_position": (1e6,) * 3}
    with pytest.raises(ParameterError, match="not positive definite"):
        replace(position, **flat).validated(3)


@pytest.mark.parametrize("value", [True, "0.1", None, [0.1], b"1", float("nan")])
def test_values_that_are_not_numbers_are_refused(value):
    position = load_profile("s500").sets["position_controller"]
    with pytest.raises(ParameterError, match="^varpi: "):
        replace(position, varpi=value).validated(3)
    with pytest.raises(ParameterError, match="^inertia: "):
        replace(position, inertia=[value, value, value]).validated(3)
