"""Geometric control, its L1 augmentation and INDI: hand-worked values, and a constant coupling."""

import math

import numpy as np
import pytest

from uam_control.laws.geometric import GeometricL1Law, GeometricLaw
from uam_control.laws.indi import IndiLaw

DT = 0.004
AXIS = {"inertia": [2.0], "lambda_1": [4.0], "lambda_2": [3.0]}
L1 = {"l1_pole": 4.0, "l1_cutoff": 2.0}


def law(kind, **changes):
    return kind(kind.kind.from_mapping(AXIS | changes, 1))


def update(a_law, e, e_dot, acceleration_d=0.0, saturated=False):
    given = (np.array([float(value)]) for value in (e, e_dot, acceleration_d))
    return a_law.update(*given, np.zeros(3), saturated, DT).item()


def test_geometric_control_by_hand():
    """2 (0.5 - 4 * 0.2 - 3 * 0.1) = -1.2"""
    a_law = law(GeometricLaw)
    assert update(a_law, 0.2, 0.1, 0.5) == pytest.approx(-1.2)
    assert a_law.adaptation[0] == pytest.approx(1.1)


def test_l1_begins_as_geometric_control_and_then_takes_what_the_predictor_missed():
    """First tick: tau = -0.6 and e_dot_hat = 0.1 - 0.3 dt. Second: e_dot = 0.1, z = -0.0012."""
    a_law = law(GeometricL1Law, **L1)
    assert update(a_law, 0.0, 0.1) == pytest.approx(-0.6)
    decay = math.exp(-4.0 * DT)
    sigma = 4.0 * decay / (1.0 - decay) * 0.0012
    added = (1.0 - math.exp(-2.0 * DT)) * sigma
    assert update(a_law, 0.0, 0.1) == pytest.approx(-0.6 - 2.0 * added)
    assert a_law.adaptation[:2] == pytest.approx([sigma, added])
    assert sigma == pytest.approx(0.3, rel=0.01)  # e_dot stayed, against tau / Mbar = -0.3


def test_indi_begins_as_pd_and_takes_the_torque_of_before():
    a_law = law(IndiLaw, indi_cutoff=10.0)
    assert update(a_law, 0.2, 0.0) == pytest.approx(-1.6)
    part = 1.0 - math.exp(-20.0 * math.pi * DT)
    # e_dot has not moved in spite of -1.6: the torque of before stays, and the same on top
    assert update(a_law, 0.2, 0.0) == pytest.approx(-1.6 - 1.6 * part)
    assert a_law.adaptation[0] == pytest.approx(-1.6 * part)


@pytest.mark.parametrize("kind", [GeometricL1Law, IndiLaw])
def test_frozen_or_saturated_it_does_not_grow(kind):
    frozen, saturated = law(kind, adapt=False), law(kind)
    for _ in range(50):
        update(frozen, 0.2, 0.0)
        update(saturated, 0.2, 0.0, saturated=True)
    assert frozen.adaptation[0] == 0.0
    taken = len(saturated.names) - 1  # the last published gain is the one that acts
    assert saturated.adaptation[taken] == 0.0


@pytest.mark.parametrize(
    ("kind", "changes"), [(GeometricLaw, {}), (GeometricL1Law, L1), (IndiLaw, {})]
)
def test_a_constant_coupling(kind, changes):
    """Mbar e_ddot = tau + Mbar sigma: geometric control leaves sigma / lambda_1, others none."""
    a_law, e, e_dot, sigma = law(kind, **changes), 0.0, 0.0, 0.8
    for _ in range(round(20.0 / DT)):
        e_dot += DT * (update(a_law, e, e_dot) / 2.0 + sigma)
        e += DT * e_dot
    assert e == pytest.approx(0.2 if kind is GeometricLaw else 0.0, abs=2e-3)
