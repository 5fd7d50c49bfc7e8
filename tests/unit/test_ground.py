"""The ground where the frame of the poses has drifted: sought from above, felt by the vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.mission.ground import seek_ground, supported


def state_at(height, rate=0.0):
    state = np.zeros((3, 8))
    state[0, 2], state[1, 2] = height, rate
    return state


@pytest.mark.parametrize(
    ("since", "height", "rate"), [(-1.0, 0.4, 0.0), (0.0, 0.4, 0.0), (1.5, 0.1, -0.2)]
)
def test_a_reference_goes_on_downwards_after_its_end(since, height, rate):
    reference = state_at(0.4)
    seek_ground(reference, since)
    np.testing.assert_allclose(reference, state_at(height, rate), atol=1e-15)


@pytest.mark.parametrize(
    ("height", "rate", "stands"),
    [(0.06, 0.0, True), (0.06, -0.09, True), (0.06, -0.2, False), (0.04, 0.0, False)],
)
def test_a_vehicle_stands_that_stays_a_quarter_of_a_metre_above_its_descent(height, rate, stands):
    assert supported(state_at(height, rate), state_at(-0.2, -0.2), 0.1) is stands
