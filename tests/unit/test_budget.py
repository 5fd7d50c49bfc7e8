"""The way of a tick from the sensors to the setpoint, from the times of its nodes."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from uam_lab.cli.main import main
from uam_lab.experiments.budget import flown, report
from uam_lab.experiments.budget.flown import Budget, CoreShares
from uam_lab.experiments.budget.path import SEGMENTS, NoTicks, tick_path, work
from uam_lab.experiments.budget.shuttle import shuttle
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.interrupts import INTERRUPTED
from uam_msgs_py.node.tick_times import COLUMNS, PARTS

MS = 1_000_000  # [ns]


def rows(*ticks: tuple) -> dict[str, np.ndarray]:
    """Columns of ticks: (stamp, woken, sending, sent [ms]); the stage is all of each tick."""
    found = {name: np.zeros(len(ticks), dtype=np.int64) for name in COLUMNS}
    for number, (stamp, woken, sending, sent) in enumerate(ticks):
        found["stamp"][number] = stamp
        for name, value in (("woken", woken), ("sending", sending), ("sent", sent)):
            found[name][number] = round(value * MS)
        found["done"][number] = found["sent"][number]
        found["stage"][number] = found["stage until sending"][number] = round(
            (sending - woken) * MS
        )
    return found


def segments(path, node) -> dict[str, float]:
    return dict(zip(SEGMENTS, path.times[0, path.nodes.index(node)].tolist(), strict=True))


def test_a_way_by_hand():
    plant, estimator = rows((4, 10.0, 10.5, 10.75)), rows((4, 11.0, 12.0, 12.25))
    path = tick_path(("plant", "estimator"), {"plant": plant, "estimator": estimator})
    assert segments(path, "plant") == {**dict.fromkeys(SEGMENTS, 0), "stage": 0.5, "publish": 0.25}
    assert segments(path, "estimator") == {
        **dict.fromkeys(SEGMENTS, 0),
        **{"wake-up": 0.25, "stage": 1.0, "publish": 0.25},
    }
    assert path.totals.tolist() == [2.25]


def test_a_node_that_is_awake_before_its_last_input_has_no_wake_up():
    source, node = rows((4, 10.0, 10.0, 11.0)), rows((4, 10.25, 12.0, 12.5))
    path = tick_path(("source", "node"), {"source": source, "node": node})
    assert segments(path, "node")["wake-up"] == 0.0
    assert segments(path, "node")["stage"] == pytest.approx(1.0)  # of 1.75, since the arrival
    assert path.totals.tolist() == pytest.approx([2.5])


def test_only_ticks_of_all_nodes_count():
    first = rows((1, 0, 1, 2), (2, 10, 11, 12), (3, 20, 21, 22))
    second = rows((2, 13, 14, 15), (3, 23, 0, 0))  # tick 3: nothing was published
    path = tick_path(("a", "b"), {"a": first, "b": second})
    assert path.stamps.tolist() == [2]


def test_nodes_without_a_common_tick_are_refused():
    with pytest.raises(NoTicks, match="no tick times of b"):
        tick_path(("a", "b"), {"a": rows((1, 0, 1, 2))})
    with pytest.raises(NoTicks, match="no tick was measured by all of a, b"):
        tick_path(("a", "b"), {"a": rows((1, 0, 1, 2)), "b": rows((2, 3, 4, 5))})


@given(st.lists(st.tuples(*(st.integers(0, 3000) for _ in range(3))), min_size=1, max_size=6))
def test_the_segments_add_up_to_the_whole_way(delays):
    """delays [us] of each node: wake-up, tick, publication."""
    now, nodes = 1.0, {}
    for number, (wake_up, tick, publication) in enumerate(delays):
        woken = now + 1e-3 * wake_up * (number > 0)
        sending = woken + 1e-3 * tick
        now = sending + 1e-3 * publication
        nodes[str(number)] = rows((7, woken, sending, now))
    path = tick_path(tuple(nodes), nodes)
    assert path.totals[0] == pytest.approx(now - 1.0, abs=1e-5)
    assert (path.times >= 0.0).all()


def test_nodes_of_one_process_share_its_tick():
    """Wake-up 1, take 2, estimator 3 (its tick is over), mission 1 of 4, publication 0.5."""
    process = rows((4, 11.0, 17.0, 17.5))
    for part, until in (("take", 2.0), ("stage", 0.0)):
        process[f"{part} until sending"][:] = round(until * MS)
    estimator, mission = rows((4, 13.0, 16.0, 16.0)), rows((4, 11.0, 20.0, 20.0))
    mission["stage until sending"][:] = 1 * MS
    measured = {
        "plant": rows((4, 9.5, 9.5, 10.0)),
        "process": process,
        "estimator": estimator,
        "mission": mission,
    }
    path = tick_path(("plant", "process"), measured, ("estimator", "mission"))
    assert path.nodes == ("plant", "process", "estimator", "mission")
    assert path.totals.tolist() == pytest.approx([8.0])
    found = segments(path, "process")
    assert found["wake-up"] == 1.0 and found["take"] == 2.0 and found["publish"] == 0.5
    assert segments(path, "estimator")["stage"] == 3.0
    assert segments(path, "mission")["stage"] == 1.0
    assert segments(path, "mission")["wake-up"] == 0.0


def test_the_slowest_ticks_have_their_own_mean():
    ticks = [(k, 10.0 * k, 10.0 * k + 1.0, 10.0 * k + 1.0) for k in range(1, 100)]
    path = tick_path(("a",), {"a": rows(*ticks, (100, 1000.0, 1008.0, 1008.0))})
    assert path.mean().sum() == pytest.approx(1.07)
    assert path.mean(0.01).sum() == pytest.approx(8.0)


def test_work_is_that_of_all_parts():
    columns = rows((1, 0, 2, 3))
    columns["before"][:] = MS // 2
    assert work(columns) == {**dict.fromkeys(PARTS, 0.0), "stage": 2.0, "other": 0.5}


def budget(tmp_path, **changes) -> Budget:
    measured = {
        "a": rows((1, 0, 1, 2), (2, 10, 11, 12)),
        "b": rows((1, 2.5, 3, 4), (2, 13, 14, 15)),
    }
    values = {
        "layout": "separate",
        "clock": "realtime",
        "folder": tmp_path,
        "path": tick_path(("a", "b"), measured),
        "work": {node: work(one) for node, one in measured.items()},
        "latency": np.arange(1.0, 1002.0),
        "missed": 5,
        "ticks": 1000,
        "pace": 1.0,
        "cores": {"mission": 0.2, "mavlink_bridge": 0.1, "mujoco_sim": 0.9, "recorder": 0.3},
    }
    return Budget(**values | changes)


def test_figures_by_hand(tmp_path):
    one = budget(tmp_path)
    assert one.figures == pytest.approx({"p50": 501.0, "p99": 991.0, "p99.9": 1e3, "max": 1001.0})
    assert one.missed_share == 0.005
    assert one.control_cores == pytest.approx(0.3)  # without plant and recorder


def test_in_lockstep_the_way_is_the_latency(tmp_path):
    one = budget(tmp_path, clock="lockstep", latency=np.zeros(0))
    assert one.figures["max"] == pytest.approx(5.0) and "| - |" in report.summary([one])


def test_picture_table_and_json_are_written(tmp_path):
    report.write(tmp_path, [budget(tmp_path)], {"command": "uam budget"})
    assert (tmp_path / "budget.png").stat().st_size > 10_000
    table = (tmp_path / "summary.md").read_text()
    assert "| separate | 501.00 | 991.00 | 1000.00 | 1001.00 | 5 of 1000 (0.500 %) | 0.30" in table
    written = json.loads((tmp_path / "budget.json").read_text())
    (layout,) = written["layouts"].values()
    assert layout["latency_ms"]["p99"] == 991.0
    assert layout["path_ms"]["mean of all ticks"]["b"]["wake-up"] == pytest.approx(0.75)


@pytest.mark.parametrize("interrupted", [False, True])
def test_a_layout_that_fails_does_not_cost_the_other_one(
    tmp_path, monkeypatch, capsys, interrupted
):
    def fly(layout, settings, observer, stop):
        if layout == flown.LAYOUTS[0]:
            return budget(tmp_path)
        stop.count += interrupted
        raise NoTicks("no tick times of mission")

    monkeypatch.setattr(flown, "fly", fly)
    assert main(["budget", "--out", str(tmp_path)]) == (INTERRUPTED if interrupted else 1)
    assert capsys.readouterr().err == "uam budget: fused: no tick times of mission\n"
    assert list(json.loads((tmp_path / "budget.json").read_text())["layouts"]) == ["separate"]


def test_cores_are_those_between_take_off_and_landing(monkeypatch):
    samples = iter([{"mission": (10.0, 1.0)}, {"mission": (12.0, 1.5)}])
    monkeypatch.setattr(flown, "spent", lambda: next(samples))
    shares, seen = CoreShares(Observer()), []
    shares._observer.update = seen.append
    for time, done in ((-1.0, False), (0.5, False), (3.0, False), (4.0, True)):
        shares.update(SimpleNamespace(time=time, done=done))
    assert shares.shares == {"mission": 0.25}
    assert len(seen) == 4


def test_the_shuttle_moves_an_arm_with_its_joints_only():
    text = shuttle(600.0)
    assert "alpha_1" in text and "alpha_1" not in shuttle(600.0, arm=False)
