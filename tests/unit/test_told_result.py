"""What `uam fly` and `uam rehearse` print at the end of a flight."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from uam_lab.cli import rehearse
from uam_lab.cli.fly import COMPLETED, NOT_COMPLETED, fly, tell
from uam_lab.flights.library.flight_result import FlightResult
from uam_lab.flights.processes.interrupts import INTERRUPTED, StopRequest
from uam_lab.records.results.outcome import Outcome, complete
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.terminal import Terminal
from uam_sim_bridge.faults.timeline import record


@pytest.mark.parametrize(
    ("outcome", "dry_run", "status"),
    [
        (Outcome(None, failure="arm_driver was killed", details=["last words"]), False, 1),
        (Outcome(None, failure="arm_driver was killed", details=["last words"]), True, 1),
        (Outcome(None, interrupted=True), False, INTERRUPTED),
        (Outcome(None), True, COMPLETED),
        (Outcome(None, notes=["a note"]), False, NOT_COMPLETED),
    ],
)
def test_the_reason_goes_to_the_errors_and_the_rest_to_the_output(
    tmp_path, capsys, outcome, dry_run, status
):
    settings, result = SimpleNamespace(dry_run=dry_run), FlightResult(tmp_path, None, outcome)
    assert tell(Terminal(), settings, result, "rehearse", False, True, ["a device"]) == status
    said = capsys.readouterr()
    assert said.out.startswith(f"results: {tmp_path}\na device\n")
    assert said.out.count("note: ") == len(outcome.notes)
    failed = "uam rehearse: arm_driver was killed\n  | last words\n"
    assert said.err == (failed if outcome.failure else "")


class Pressed(StopRequest):
    """Ctrl-C, `presses` times in the flight."""

    presses = 1

    def __enter__(self):
        self.count = self.presses
        return self

    def __exit__(self, *exception):
        pass


@pytest.mark.parametrize("presses", [1, 2])
def test_a_second_ctrl_c_leaves_out_the_report(tmp_path, monkeypatch, presses):
    result = FlightResult(tmp_path, {}, Outcome(None, interrupted=True))
    flight = MagicMock(result=result, folder=tmp_path)
    told = []
    monkeypatch.setattr(Pressed, "presses", presses)
    monkeypatch.setattr("uam_lab.cli.fly.Interrupts", Pressed)
    monkeypatch.setattr("uam_lab.cli.fly.Flight", lambda **_: flight)
    monkeypatch.setattr("uam_lab.cli.fly.tell", lambda *given: told.append(given))
    settings = SimpleNamespace(scenario=SimpleNamespace(landing=SimpleNamespace(end=1.0)))
    fly(settings, video=True, report=True)
    assert told[0][5] is (presses == 1) and len(result.outcome.notes) == presses - 1


def test_a_rehearsal_ends_as_a_flight():
    assert rehearse.fly is fly


def test_a_fault_that_did_not_begin_is_a_note(tmp_path, make_flight):
    series = make_flight()
    begun = [record("mocap_dropout", 5.0, None, {}), record("wind_gust", 6.0, 7.0, {"speed": 2.0})]
    planned = [
        {"fault": "mocap_dropout", "at": 5.0},
        {"fault": "mocap_dropout", "at": "pick", "after": 500.0},
        {"fault": "wind_gust", "at": "land", "speed": 3.0},
        {"fault": "wind_gust", "at": 6.0, "duration": 1.0, "speed": 2.0},
        {"fault": "motor_loss", "at": 900.0},
    ]
    known = series.info | {"faults_planned": planned}
    outcome = Outcome(series, faults=begun)
    for _ in range(2):  # as the flight and as its log
        complete(ResultFolder(tmp_path), known, outcome)
    late = "did not begin: the flight ended before"
    assert outcome.notes == [
        f"the fault mocap_dropout@pick+500 {late}",
        f"the fault wind_gust@land {late}",
        f"the fault motor_loss@900.0 {late}",
    ]
