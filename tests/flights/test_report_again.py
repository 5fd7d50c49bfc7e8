"""`uam report`: from the log alone, from a truncated log, for several flights."""

import json
import shutil

import pytest

from uam_lab.cli import main
from uam_lab.records.rebuild import rebuild
from uam_lab.records.results import timeseries
from uam_lab.report.figures import figures


@pytest.fixture
def few_figures(monkeypatch):
    """Draw only two figures."""
    for name in list(figures.FIGURES)[2:]:
        monkeypatch.delitem(figures.FIGURES, name)


def alone(flight, folder, part=1.0):
    """Return a folder that contains only the first `part` of the log of a flight."""
    folder.mkdir()
    data = (flight.out / "log.mcap").read_bytes()
    (folder / "log.mcap").write_bytes(data[: int(part * len(data))])
    return folder


def test_the_log_alone_gives_the_same_table_metrics_and_page(shared_flights, tmp_path, few_figures):
    out, again = shared_flights.single.out, alone(shared_flights.single, tmp_path / "again")
    assert main.main(["report", str(again), "--no-pictures"]) == 0
    before, after = (timeseries.read(f / "timeseries.parquet") for f in (out, again))
    assert before.values.tobytes() == after.values.tobytes()
    metrics = [json.loads((folder / "metrics.json").read_text()) for folder in (out, again)]
    for figures_of in metrics:
        assert figures_of.pop("wall_s") > 0.0 and figures_of.pop("real_time_factor") > 0.0
    assert metrics[0] == metrics[1]
    for name in ("parameters.yaml", "versions.json", "stability.json"):
        assert (again / name).read_text() == (out / name).read_text(), name
    page = (again / "report.html").read_text()
    assert "Mission completed" in page and "--seed 3" in page


def test_a_truncated_log_gives_a_partial_report(shared_flights, tmp_path):
    cut = alone(shared_flights.single, tmp_path / "cut", 0.6)
    metrics = rebuild(cut, tmp_path / "out")
    assert not metrics["mission_completed"]
    info = json.loads((tmp_path / "out/info.json").read_text())
    assert info["partial"] is True
    assert info["notes"] == [
        "partial: the recording ends with the flight (the log ends before the mission was over)"
    ]
    assert [file.name for file in cut.iterdir()] == ["log.mcap"], "unchanged"
    whole = timeseries.read(shared_flights.single.out / "timeseries.parquet")
    part = timeseries.read(tmp_path / "out/timeseries.parquet")
    assert 500 < len(part) < len(whole)


def test_two_flights_overlaid(shared_flights, tmp_path, few_figures, capsys):
    cut = alone(shared_flights.uav2, tmp_path / "cut", 0.6)
    out = tmp_path / "both"
    assert main.main(["report", str(shared_flights.single.out), str(cut), "--out", str(out)]) == 0
    page = (out / "report.html").read_text()
    assert "2 flights" in page and page.count("<td>cut</td>") == 3
    assert page.count('<img src="data:image/png') == 2
    assert [file.name for file in cut.iterdir()] == ["log.mcap"]


def test_a_folder_without_flight_is_refused_in_one_line(tmp_path, capsys):
    assert main.main(["report", str(tmp_path)]) == 2
    (tmp_path / "log.mcap").write_bytes(b"no log")
    assert main.main(["report", str(tmp_path)]) == 2
    shutil.rmtree(tmp_path)
    message = capsys.readouterr().err.splitlines()
    assert message[0].endswith("has neither log.mcap nor metrics.json for a report")
    assert message[1].endswith("is not an MCAP file")
