"""Parameter changes in messages, figures and report."""

import json
import math

import pytest

from uam_lab.report.facts import parameter_table
from uam_lab.report.figures import figures
from uam_lab.report.figures.figures import draw
from uam_lab.report.figures.panels import DrawnFlight
from uam_lab.report.page import pages


def entry(time, accepted=True, **values):
    return {
        "time_s": time,
        "node": "arm_controller",
        "by": "parameter service",
        "accepted": accepted,
        "reason": "" if accepted else "varpi: <no>",
        "values": values,
    }


def test_a_change_is_read_back_from_its_message():
    pytest.importorskip("rclpy")
    from uam_msgs_py.messages.flight_events import ParameterChange

    values = {"varpi": (0.1, math.inf), "law": ("a -> b", None), "nu": ([1.0, 2.0], [1.0])}
    change = ParameterChange("arm_controller", "parameter service", values, "varpi: no")
    assert ParameterChange.from_message(change.to_message(1_500_000_000)) == (1_500_000_000, change)
    accepted = ParameterChange("mission", "x", {"adapt": (True, False)})
    assert accepted.accepted and not change.accepted
    assert ParameterChange.from_message(accepted.to_message(0)) == (0, accepted)


def test_numbers_that_would_overlap_share_one_label():
    info = {"parameter_changes": [entry(t, varpi=[0.1, 0.2]) for t in (1.0, 1.1, 1.2, 9.0)]}
    assert parameter_table.labels(parameter_table.changes(info), 1.0) == [(1.0, "1–3"), (9.0, "4")]
    many = {"parameter_changes": [entry(float(t)) for t in range(100)]}
    assert parameter_table.labels(parameter_table.changes(many), 0.5) == []


def test_changes_are_drawn_and_listed(flight_folder, flight, make_flight):
    entries = [entry(10.0, varpi=[0.1, 0.2]), entry(20.0, False, varpi=[0.2, -1.0]), entry(-5.0)]
    marked = make_flight(info={"parameter_changes": entries})
    figure = figures.arm_inputs([DrawnFlight("x", marked)])
    axis = figure.axes[0]
    lines = [c for c in axis.collections if len(c.get_segments()) == 1]
    assert [line.get_segments()[0][0][0] for line in lines] == [10.0, 20.0]
    assert {"1", "2"} <= {text.get_text() for text in axis.texts}
    assert [t.get_text() for t in figure.legends[0].texts][-2:] == [
        "parameters changed",
        "change refused",
    ]
    draw([DrawnFlight("x", marked)], flight_folder / "figures", names=["arm_inputs"])
    (flight_folder / "info.json").write_text(json.dumps(marked.info))
    html = pages.write_page(flight_folder).read_text()
    assert "Parameters changed in flight" in html and "varpi: &lt;no&gt;" in html
    assert "2 requests were accepted" in html
