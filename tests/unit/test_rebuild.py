"""A result folder is rebuilt from its log: latencies of a rehearsal, folder of another flight."""

import json

import pytest

pytest.importorskip("rclpy")

from logged_flight import vehicles_log

from uam_lab.records.rebuild import rebuild
from uam_lab.records.results.result_folder import ResultFolderError


@pytest.fixture
def rehearsed(tmp_path):
    """The result folder of a rehearsal: a log with the simulator's truth, on the wall clock."""
    folder = tmp_path / "rehearsal"
    (folder / "logs").mkdir(parents=True)
    vehicles_log(folder, truth=True)
    (folder / "logs/laboratory.json").write_text(json.dumps({"wall_s": 3.0}))
    (folder / "info.json").write_text(json.dumps({"clock": "realtime", "scenario": "hover"}))
    return folder


def test_a_rehearsal_keeps_its_latencies(rehearsed, tmp_path):
    for out in (rehearsed, tmp_path / "again"):
        found = rebuild(rehearsed, out)
        assert found["latency_ms"]["p50"] == pytest.approx(3.0) and found["missed_ticks"] == 5
        assert json.loads((out / "metrics.json").read_text()) == found


def test_the_folder_of_another_flight_is_refused(rehearsed, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "metrics.json").write_text("{}")
    with pytest.raises(ResultFolderError, match="a flight or a report; give another --out"):
        rebuild(rehearsed, other)
    assert [file.name for file in other.iterdir()] == ["metrics.json"]
    rebuild(rehearsed, rehearsed / "../rehearsal")  # the same one by another name


def test_a_folder_that_cannot_be_made_is_named(rehearsed, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ResultFolderError, match="file cannot be written: file exists"):
        rebuild(rehearsed, tmp_path / "file")
