"""Result of a rehearsal, from its log and the laboratory's statistics."""

from __future__ import annotations

from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.processes.processes import NodeFailed
from uam_lab.records.recording.log_reader import read_flight
from uam_lab.records.recording.logged_topics import Log
from uam_lab.records.recording.mcap_reader import UnreadableLog
from uam_lab.records.recording.node_statistics import LABORATORY_FILE, losses, statistics
from uam_lab.records.recording.setpoint_latencies import latencies
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder

REFUSED = "start refused: "


def read_outcome(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    refused: str,
    interrupted: bool,
) -> Outcome:
    """Return the outcome of the rehearsal in `folder`.

    failure: the failed node, if any; refused: why the mission was not started, "" if it was.
    """
    outcome = Outcome(series=None, interrupted=interrupted)
    logs = folder.path / "logs"
    numbers = statistics(logs / LABORATORY_FILE)
    if refused:
        outcome.failure = REFUSED + refused
    elif failure is not None and not interrupted:
        outcome.failure, outcome.details = str(failure), failure.last_lines
    outcome.wall_s = float(numbers.get("wall_s", 0.0))
    if lost := numbers.get("lost_s"):
        outcome.notes.append(f"the plant could not keep real time: {lost:.2f} s lost")
    outcome.notes.extend(losses(logs))
    try:
        log = Log.read(folder.log)
        flight = read_flight(folder.log, settings.scenario, vehicle=settings.vehicle)
    except (UnreadableLog, OSError) as error:
        outcome.failure = outcome.failure or f"nothing recorded: {error}"
        return outcome
    period = settings.vehicle.control_period
    outcome.latency_s, outcome.missed_ticks = latencies(log, period)
    flight.tell(outcome)
    if not flight.done and not outcome.partial:
        outcome.failure = numbers.get("ended_by") or "the mission did not end"
    return outcome
