"""The charts of the cockpit: what is stored is sent to the page."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser")

from sensor_msgs.msg import JointState

from uam_lab.cockpit.charts import Charts
from uam_msgs_py.messages import topics


class Page(dict):
    """Charts by their title, in place of viser's."""

    def add_tab(self, *_):
        return nullcontext()

    def add_uplot(self, data, series, title, **_):
        self[title] = SimpleNamespace(data=data)
        return self[title]


@pytest.mark.parametrize("hand", [True, False])
def test_every_error_is_drawn(hand):
    page = Page()
    charts = Charts(page, page, 30.0, 0.1, ("alpha_1", "alpha_2"), hand)
    message = JointState(position=[0.01] * 3 + [0.1] * 3 + [0.2] * 2 + [0.004] * 3 * hand)
    message.header.stamp.sec = 7
    charts.show(topics.TRACKING_ERROR, message)
    charts.draw()
    expected = {
        "Position error [cm]": [7.0, *[1.0] * 3],
        "Attitude error [deg]": [7.0, *[5.7296] * 3],
        "Arm error [deg]": [7.0, *[11.4592] * 2],
    } | ({"End effector error [mm]": [7.0, *[4.0] * 3]} if hand else {})
    drawn = {title: np.ravel(one.data) for title, one in page.items() if one.data[0][0] == 7.0}
    assert set(drawn) == set(expected)
    for title, row in expected.items():
        np.testing.assert_allclose(drawn[title], row, atol=1e-4)
