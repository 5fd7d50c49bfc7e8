"""Converts the log.mcap of a flight to the table of its control ticks.

A tick is a stamp of /uam/truth/state for which the mission had a reference. All other topics are
joined to it by stamp. A vehicle has no truth: then the estimate, /uam/state, stands in its columns.
Without a message of the same stamp (gains come at 50 Hz; in real time messages may be lost) a tick
has the last value before it, as in the receiving nodes. Ticks whose state and reference the fused
process did not send (`inner_rate`) are left out: their errors would contain the motion since.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.coordinates import ALPHA, ARM, ATTITUDE, ROLL
from uam_control.mission import Scenario
from uam_control.mission.mission_output import ABORTED, LANDED, RELEASED, TOUCHDOWN, WAITING
from uam_control.mission.motion.flatness import Flyer
from uam_control.stamps import SECOND
from uam_control.supervision import State
from uam_control.vehicle import VehicleDescription, load_description
from uam_lab.records.recording.logged_topics import ADAPTATION, Log, StampedRows, latencies
from uam_lab.records.recording.mcap_reader import UnreadableLog
from uam_lab.records.results import timeseries
from uam_lab.records.results.outcome import Outcome, grasp_decision, transition
from uam_lab.records.results.timeseries import SUBSYSTEMS, Columns, FlightTable, gain_columns
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import FaultEvent, ParameterChange
from uam_msgs_py.messages.status import MissionStatus
from uam_sim_bridge.faults.timeline import record

SILENCE = 1e9  # [ns] without references after which the mission counts as lost
STANDS = 0.01  # [1] motor command
ESTIMATE = "estimate"
STATE_ROWS = ("positions", "velocities", "accelerations")


class References:
    """References of the mission: stamps (m,) [ns]; rows (m, 3 size + 1), each with chi_d,
    chi_d_dot, chi_d_ddot and whether position and attitude are flown."""

    def __init__(self, log: Log, size: int):
        """size: number of entries of chi."""
        stamps, rows, flying = [], [], []
        self.takeoff: int | None = None  # stamp [ns] of mission time 0; None: no take-off
        for block in log.blocks(topics.REFERENCE):
            whole = len(block.names) == size
            values = np.zeros((len(block.stamps), 3, size))
            for i, row in enumerate(STATE_ROWS):
                values[:, i, slice(None) if whole else ARM] = block.fields[row]
            stamps.append(block.stamps)
            rows.append(values.reshape(len(values), -1))
            flying.append(np.full((len(values), 1), float(whole)))
            if whole:
                since = block.fields["time_from_start"]
                flown = since > 0  # 0 also while a person tilts the vehicle by hand, before it
                if not flown.any() and log.arming_commanded:  # a mission that does not count it
                    flown[:] = True
                if flown.any():
                    self.takeoff = int(np.min((block.stamps - since)[flown]))
        if not stamps:
            raise UnreadableLog(f"{log.name} has no reference: the mission did not start")
        joined = np.hstack([np.vstack(rows), np.vstack(flying)])
        self.samples = StampedRows(np.concatenate(stamps), joined)
        self._hold_after_landing(size)

    def _hold_after_landing(self, size: int) -> None:
        """Keep the last reference of the pose after the flight, which has none of its own."""
        rows = self.samples.rows
        flights = np.flatnonzero(rows[:, -1])
        if len(flights):
            pose = [c for c in range(3 * size) if c % size < ALPHA]
            rows[flights[-1] + 1 :, pose] = rows[flights[-1], pose]


def read_flight(
    path: Path,
    scenario: Scenario,
    info: Mapping[str, Any] | None = None,
    vehicle: VehicleDescription | None = None,
) -> Outcome:
    """Return the outcome of the flight of `scenario` recorded in `path`: what the log has of it.

    vehicle: of a log without the simulator's topics, None for the default one; latencies are of
    the wall clock. Raises UnreadableLog if the file is no log or its flight did not start.
    """
    log = Log.read(path)
    statuses = log.statuses()
    end = next((stamp for stamp, status in statuses if status.done), None)
    abort_reason = statuses[-1][1].abort_reason if statuses else ""
    simulated = log.width(topics.TRUTH_STATE) > 0
    vehicle = vehicle or load_description()
    if simulated:
        joints = log.width(topics.TRUTH_STATE) - ALPHA
        flyer = Flyer.with_hand(vehicle) if joints == len(vehicle.joints) else None
        rotors = log.width(topics.TRUTH_ROTORS)
    else:
        flyer = Flyer.with_hand(vehicle)
        joints, rotors = len(vehicle.joints), len(vehicle.rotors)
    fingers = log.width(topics.TRUTH_MAGNET) > 2  # magnet, swing
    columns = timeseries.columns(joints, rotors, flyer is not None, fingers)
    states = topics.TRUTH_STATE if simulated else topics.STATE
    references = References(log, columns.size)
    truth = log.samples(states, STATE_ROWS, columns.size)
    first, last = references.samples.stamps[[0, -1]]
    # The mission is one tick ahead: its last reference is for a tick without control. Ticks after
    # the mission's end depend on the time until the plant receives the end, so they are cut off,
    # unless the motors turn: then the table ends when they stand.
    if end is not None:
        last = min(last, max(end, _still(log, end, columns.rotors) if simulated else end) + 1)
    else:
        last = _last_of_all(last, truth.stamps)
    every = truth.stamps[(truth.stamps >= first) & (truth.stamps < last)]
    if not len(every):
        raise UnreadableLog(f"{path} has no control tick")
    state = log.samples(topics.STATE, STATE_ROWS, columns.size)
    ticks = every[~withheld(log, every, state.stamps, references.samples.stamps)]
    notes = []
    if len(ticks) < len(every):
        text = f"table and errors have {len(ticks)} of {len(every)} ticks"
        notes.append(f"{text}: the log has no state and no reference of the others (inner_rate)")
    recording = FlightTable(len(ticks), columns, flyer)
    values = recording.values
    takeoff = references.takeoff if references.takeoff is not None else int(last)
    time = values[:, columns["time"]] = (ticks - takeoff) / SECOND
    values[:, columns.block("truth.")] = truth.at(ticks)
    values[:, columns.block("estimate.")] = state.at(ticks)
    reference = references.samples.at(ticks)
    flying = (reference[:, -1] > 0.5) & (time >= 0.0)  # without the checks by hand
    if flying.any():
        scenario = scenario.begun_at(reference[np.argmax(flying), : columns.size])
    values[:, columns.block("reference.")] = reference[:, :-1]
    _commands(log, ticks, recording)
    for subsystem in SUBSYSTEMS:
        adaptation(log, subsystem, ticks, values, columns)
    if simulated:
        _truth(log, ticks, recording)
    else:
        _measured(log, ticks, recording, statuses)
    for number, name in enumerate(phases(ticks, time, flying, scenario, statuses)):
        recording.phases[number] = recording.phase_names.setdefault(
            name, len(recording.phase_names)
        )
    released = np.flatnonzero(recording.phases == recording.phase_names.get(RELEASED, -1))
    # the mission's reference follows the vehicle then, and is not published
    to, of = (columns.block(name).start + np.arange(ALPHA) for name in ("reference.", "estimate."))
    values[np.ix_(released, to)] = values[np.ix_(released, of)]
    recording.count = len(ticks)
    faults = fault_records(log.diagnostics(topics.FAULTS, FaultEvent.from_message), takeoff)
    outcome = Outcome(
        series=recording.series(info),
        wall_s=log.wall_seconds(states),
        abort_reason=abort_reason,
        parameter_changes=parameter_changes(log, takeoff),
        transitions=transitions(statuses, takeoff),
        grasps=grasps(statuses, takeoff),
        faults=faults,
        done=end is not None,
        notes=[*log.notes, *notes],  # the last: what is read above adds some
    )
    if not simulated:
        outcome.errors_of = ESTIMATE
    begin, end = (ticks[flying] if flying.any() else ticks)[[0, -1]]
    flown = state.stamps[(state.stamps >= begin) & (state.stamps <= end)]
    outcome.latency_s, outcome.missed_ticks = latencies(log, vehicle.control_period, flown)
    return outcome


def withheld(log: Log, ticks: np.ndarray, states: np.ndarray, references: np.ndarray) -> np.ndarray:
    """Return (m,) whether the fused process kept the inner topics of ticks (m,) [ns] to itself.

    Their setpoint is there, state and reference are not. states, references: stamps of the messages
    [ns]. A node that is late or lost leaves no setpoint of its ticks.
    """
    setpoints, _ = log.published(topics.SETPOINT)
    inner = np.isin(ticks, states) | np.isin(ticks, references)
    return np.isin(ticks, setpoints) & ~inner


def _still(log: Log, end: int, rotors: int) -> int:
    """Return the stamp [ns] of the last command that turns a motor from `end` on, 0 without one."""
    commands = log.samples(topics.TRUTH_ROTORS, ("position",), rotors)
    turning = commands.stamps[(commands.stamps >= end) & (commands.rows > STANDS).any(axis=1)]
    return int(turning[-1]) if len(turning) else 0


def _last_of_all(last: int, truth: np.ndarray) -> int:
    """Return the end [ns] of the table of a flight without an end of the mission.

    last: stamp of the last reference [ns]; truth (m,): stamps of the true state [ns]. If the
    mission node was lost in flight, the table contains the rest of the flight.
    """
    return int(truth[-1]) + 1 if len(truth) and truth[-1] - last > SILENCE else int(last)


def parameter_changes(log: Log, takeoff: int) -> list[dict[str, Any]]:
    """Return the requested parameter changes, in order; takeoff: stamp [ns] of mission time 0.

    time_s: mission time of the last tick with the old values; node, by, reason, values: see
    `ParameterChange`.
    """
    found = []
    for stamp, change in log.diagnostics(topics.CHANGES, ParameterChange.from_message):
        entry = {
            "time_s": (stamp - takeoff) / SECOND,
            "node": change.node,
            "by": change.by,
            "accepted": change.accepted,
            "reason": change.reason,
            "values": {name: list(pair) for name, pair in change.values.items()},
        }
        found.append(entry)
    return sorted(found, key=lambda entry: entry["time_s"])


def adaptation(
    log: Log, subsystem: str, ticks: np.ndarray, values: np.ndarray, columns: Columns
) -> None:
    """Fill in the gains of a subsystem's law at ticks (m,) [ns] in the columns of values (m, n)."""
    for block in log.blocks(ADAPTATION[subsystem]):
        gains = StampedRows(block.stamps, block.fields["position"])
        values[:, gain_columns(subsystem, block.names, columns)] = gains.at(ticks)


def _commands(log: Log, ticks: np.ndarray, table: FlightTable) -> None:
    """Fill in the commands of the controllers and the desired attitude of the position law."""
    values, columns = table.values, table.columns
    position = log.samples(topics.POSITION_COMMAND, (*STATE_ROWS, "effort"), ALPHA).at(ticks)
    attitude = [columns[f"reference.{angle}"] for angle in ("roll", "pitch", "yaw")]
    for row in range(3):
        angles = [column + row * columns.size for column in attitude]
        values[:, angles] = position[:, ALPHA * row :][:, ATTITUDE]
    efforts = position[:, len(STATE_ROWS) * ALPHA :]  # tau_p, then zeros for the attitude
    values[:, columns.block("tau_p.")] = efforts[:, :ROLL]
    torque = log.samples(topics.ATTITUDE_COMMAND, ("effort",), 3)
    values[:, columns.block("tau_q.")] = torque.at(ticks)
    effort = log.samples(topics.ARM_COMMAND, ("effort",), columns.joints)
    values[:, columns.block("tau_alpha.")] = effort.at(ticks)
    setpoint = log.samples(topics.SETPOINT, ("angular", "linear"), 3).at(ticks)
    values[:, columns.block("setpoint.")] = setpoint[:, [0, 1, 2, 5]]
    factor = log.samples(topics.THRUST, ("position",), 1).at(ticks)
    values[:, columns["thrust.factor"]] = factor[:, 0]


def _truth(log: Log, ticks: np.ndarray, table: FlightTable) -> None:
    """Fill in the data that only the simulator has: rotors, payload, magnet."""
    values, columns = table.values, table.columns
    count = columns.rotors
    rotors = log.samples(topics.TRUTH_ROTORS, ("position", "effort"), count).at(ticks)
    for i in range(count):
        values[:, columns[f"rotor_{i + 1}.command"]] = rotors[:, i]
        values[:, columns[f"rotor_{i + 1}.thrust"]] = rotors[:, count + i]
    position = log.samples(topics.TRUTH_PAYLOAD, ("position",), 3).at(ticks)
    x, y, z, w = log.samples(topics.TRUTH_PAYLOAD, ("orientation",), 4).at(ticks).T
    values[:, columns.block("payload.")] = np.column_stack([position, w, x, y, z])
    fingers = "gripper.opening" in columns
    magnet = log.samples(topics.TRUTH_MAGNET, ("position", "effort"), 2 + fingers).at(ticks)
    values[:, columns.block("magnet.")] = magnet[:, [0, 2 + fingers, 1]]
    if fingers:
        values[:, columns.block("gripper.")] = magnet[:, [2, 5]]


def _measured(
    log: Log,
    ticks: np.ndarray,
    table: FlightTable,
    statuses: Sequence[tuple[int, MissionStatus]],
) -> None:
    """Fill in what a vehicle has in place of the simulator's data: the payload's poses, if any, and
    the commanded magnet."""
    values, columns = table.values, table.columns
    position = log.samples(topics.PAYLOAD, ("position",), 3).at(ticks)
    x, y, z, w = log.samples(topics.PAYLOAD, ("orientation",), 4).at(ticks).T
    values[:, columns.block("payload.")] = np.column_stack([position, w, x, y, z])
    stamps = np.array([stamp for stamp, _ in statuses], dtype=np.int64)
    on = np.array([[float(status.magnet)] for _, status in statuses]).reshape(-1, 1)
    values[:, columns["magnet.on"]] = StampedRows(stamps, on).at(ticks)[:, 0]


def transitions(
    statuses: Sequence[tuple[int, MissionStatus]], takeoff: int
) -> list[dict[str, Any]]:
    """Return the supervisor's state changes, see `outcome.transition`."""
    found = []
    for (_, before), (stamp, now) in pairwise(statuses):
        if now.state != before.state:
            time = (stamp - takeoff) / SECOND
            found.append(transition(time, before.state, now.state, now.cause))
    return found


def grasps(statuses: Sequence[tuple[int, MissionStatus]], takeoff: int) -> list[dict[str, Any]]:
    """Return the decisions about the payload, see `outcome.grasp_decision`."""
    found = []
    for (_, before), (stamp, now) in pairwise(statuses):
        if now.decisions != before.decisions and now.decisions:
            time = (stamp - takeoff) / SECOND
            found.append(grasp_decision(time, now.grasp, now.attempt, now.grasp_text))
    return found


def phases(
    ticks: np.ndarray,
    time: np.ndarray,
    flying: np.ndarray,
    scenario: Scenario,
    statuses: Sequence[tuple[int, MissionStatus]],
) -> Iterator[str]:
    """Yield the phase of each tick; ticks (m,) [ns], time (m,) [s], flying (m,): position and
    attitude are controlled.

    It is the phase of the scenario; once the mission has left the scenario, that of its status.
    """
    left = any(
        status.state in (State.HOLDING.value, State.RELEASED.value)
        or status.phase == TOUCHDOWN
        or status.delay > 0.0
        or (status.state == State.LANDING.value and status.abort_reason)
        for _, status in statuses
    )
    flights = np.flatnonzero(flying)
    takeoff = flights[0] if len(flights) else len(time)
    last = statuses[-1][1] if statuses else MissionStatus()
    ended = last.phase
    if ended not in (LANDED, ABORTED):  # the log was cut off
        ended = ABORTED if last.abort_reason else LANDED
    stamps = [stamp for stamp, _ in statuses]
    for number, now in enumerate(time.tolist()):
        newest = bisect_right(stamps, ticks[number]) - 1 if left else -1
        released = newest >= 0 and statuses[newest][1].state == State.RELEASED.value
        if flying[number] or released:
            yield statuses[newest][1].phase if newest >= 0 else scenario.phase(max(now, 0.0))
        elif number < takeoff:
            yield WAITING
        else:
            yield ended


def fault_records(events: Iterable[tuple[int, FaultEvent]], takeoff: int) -> list[dict[str, Any]]:
    """Return the faults of a log, see `timeline.record`.

    events: with their stamps [ns]; takeoff: stamp [ns] of mission time 0.
    """
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for stamp, event in events:
        time, key = (stamp - takeoff) / SECOND, (event.place, event.number)
        if event.active:
            found[key] = record(event.name, time, None, event.parameters)
        elif key in found:
            found[key]["end_s"] = round(time, 6)
    return sorted(found.values(), key=lambda entry: entry["begin_s"])
