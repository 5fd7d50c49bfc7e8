"""An estimator of somebody's own: its stage decides as the compiled one; profiles choose it."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from uam_control.estimation import EstimatorParameters, StateEstimator, catalogue
from uam_control.estimation.base import BaseParameters
from uam_control.profiles.profile import load_profile
from uam_control.settings.parameter_file import ProfileError
from uam_control.settings.parameter_set import choice
from uam_control.stages.estimator_stage import (
    HELD_BACK,
    EstimatorStage,
    PlainEstimatorStage,
    estimator_stage,
)

PERIOD, TICK = 0.004, 4_000_000  # [s], [ns]


class OwnEstimator(StateEstimator):
    """The usual one, called from Python."""


@pytest.fixture
def own(monkeypatch):
    monkeypatch.setitem(catalogue.ESTIMATORS, "complementary", OwnEstimator)


def states(stage, spoilt=()):
    """States of 400 ticks of a vehicle that swings; spoilt: ticks whose force is not finite."""
    noise, found = np.random.default_rng(2), []
    for k in range(400):
        level, swing = np.array([1.0, 0.0, 0.0, 0.0]), 0.1 * math.sin(0.01 * k)
        if k % 2 == 0:
            stage.mocap(k * TICK - 5_000_000, np.array([swing, 0.0, 1.0]), level)
        stage.joints(k * TICK, np.array([swing, 1.0]), np.zeros(2))
        force = noise.normal((0.0, 0.0, 9.81), 0.05)
        force[2] = math.nan if k in spoilt else force[2]
        for _ in range(1 + (k == 7)):  # one sample comes twice
            state = stage.imu(k * TICK, noise.normal(0.0, 0.01, 3), force)
            found.append(None if state is None else state.copy())
    return found


@pytest.mark.parametrize("spoilt", [(), (50,)])
def test_the_stage_of_a_python_estimator_decides_as_the_compiled_one(own, spoilt):
    plain = estimator_stage(EstimatorParameters(), 2, PERIOD)
    compiled = EstimatorStage(EstimatorParameters(), 2, PERIOD)
    assert type(plain) is PlainEstimatorStage
    ours, theirs = states(plain, spoilt), states(compiled, spoilt)
    assert len(ours) == 401 and ours[8] is None  # the repeated sample
    for one, other in zip(ours, theirs, strict=True):
        assert (one is None) == (other is None)
        assert one is None or (one == other).all()
    assert plain.diverged == compiled.diverged == len(spoilt)
    silent = sum(one is None for one in ours)
    assert silent >= HELD_BACK // TICK if spoilt else silent == 1


def test_the_usual_estimator_flies_compiled():
    assert type(estimator_stage(EstimatorParameters(), 2, PERIOD)) is EstimatorStage


def test_a_profile_on_top_of_a_whole_one_chooses_an_estimator(tmp_path, monkeypatch):
    @dataclass(frozen=True)
    class OwnParameters(BaseParameters):
        estimator: str = choice("own", "the estimator that flies", ("own",), fixed=True)

    class Own(StateEstimator):
        kind = OwnParameters

    monkeypatch.setitem(catalogue.ESTIMATORS, "own", Own)
    file = tmp_path / "own.yaml"
    file.write_text("state_estimator:\n  ros__parameters:\n    estimator: own\n")
    found = load_profile("s500", str(file))
    assert "position_bandwidth" not in found.section("state_estimator")
    file.write_text("state_estimator:\n  ros__parameters:\n    estimator: ow\n")
    with pytest.raises(ProfileError, match="'ow' is not one of complementary, own"):
        load_profile("s500", str(file))
