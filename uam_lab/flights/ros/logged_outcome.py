"""Result of a flight with the ROS engine, from its log and the statistics of the nodes."""

from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.processes.processes import NodeFailed
from uam_lab.records.recording.log_reader import read_flight
from uam_lab.records.recording.logged_topics import RECORDER, losses
from uam_lab.records.recording.mcap_reader import UnreadableLog
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder, known_json


def read_outcome(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    interrupted: bool,
) -> Outcome:
    """Return the outcome of the flight in `folder`; failure: the failed node, if any."""
    logs, notes = folder.path / "logs", []
    numbers = known_json(logs / "mujoco_sim.json")
    realtime = settings.clock == "realtime"
    late, total = numbers.get("late_ticks", 0), numbers.get("answerable_ticks", 0)
    if late and realtime:
        notes.append(f"{late} of {total} setpoints were more than one control period late")
    outcome = logged(settings, folder, failure, interrupted, notes)
    if not outcome.errors_of:  # in simulation
        outcome.wall_s = numbers.get("wall_s", 0.0)
        if realtime:
            outcome.latency_s = numbers.get("latency_s", [])
            outcome.missed_ticks = numbers.get("missed_ticks")
    if outcome.series is None or outcome.done or outcome.partial:
        return outcome
    full = known_json(logs / RECORDER).get("ended")
    ended = full or numbers.get("ended_by")
    if settings.dry_run and ended and not full:
        outcome.abort_reason = f"dry run, {ended}: nothing was armed"
    else:
        outcome.failure = ended or "the log has no end of the mission"
    return outcome


def logged(
    settings: FlightSettings,
    folder: ResultFolder,
    failure: NodeFailed | None,
    interrupted: bool,
    notes: list[str],
) -> Outcome:
    """Return what the log of a flight has; `notes` and the losses of the nodes come first."""
    try:
        outcome = read_flight(folder.log, settings.scenario, vehicle=settings.vehicle)
    except (UnreadableLog, OSError) as error:
        why = error if folder.log.exists() else "the flight ended before the recorder began"
        outcome = Outcome(series=None, failure=f"nothing recorded: {why}")
    outcome.interrupted = interrupted
    if failure is not None and not interrupted:
        outcome.failure, outcome.details = str(failure), failure.last_lines
    every = [*notes, *losses(folder.path / "logs"), *outcome.notes]
    outcome.notes = list(dict.fromkeys(every))
    return outcome
