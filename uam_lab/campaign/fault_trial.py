"""One flight of a fault matrix, in either engine, and its result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from uam_control.mission import Scenario, load_scenario
from uam_control.profiles.profile import Profile
from uam_lab.campaign import quiet
from uam_lab.campaign.fault_matrix import Cell
from uam_lab.campaign.fault_outcome import COMPLETED, LOST, classify, down_after
from uam_lab.flight.direct.flight import DirectFlight
from uam_lab.flight.settings import ONLOOKERS, FlightSettings
from uam_lab.results import metrics
from uam_lab.results.outcome import transitions
from uam_lab.results.timeseries import Series
from uam_sim_bridge.faults import PROCESS
from uam_sim_bridge.plant import Vehicle


@dataclass(frozen=True)
class FaultTrial:
    """One flight of the profile's vehicle. scenario: name or file; payload_mass [kg]."""

    cell: Cell
    scenario: str
    profile: Profile
    payload_mass: float
    seed: int
    engine: str = "direct"
    clock: str = "lockstep"

    def load_scenario(self) -> Scenario:
        """Return the scenario, for the vehicle. Raises ScenarioError."""
        return load_scenario(self.scenario, self.profile.vehicle)


@dataclass(frozen=True)
class FaultResult:
    """Result of one flight. why: unmet criteria of a completed mission.

    down_after_s: from the fault to the final touchdown, None if the mission was completed or
    without touchdown. kept: whether the promise was kept, None without a promise. worst: largest
    errors of the flight, with the keys of `max` in metrics.json. happened: the injected faults, see
    `faults.timeline.record`.
    """

    fault: str
    moment: str
    outcome: str
    why: str
    duration_s: float
    worst: Mapping[str, list[float | None]] = field(default_factory=dict)
    happened: tuple[dict[str, Any], ...] = ()
    down_after_s: float | None = None
    kept: bool | None = None


def fly(trial: FaultTrial) -> FaultResult:
    """Fly a trial. Raises ConfigurationError, ScenarioError."""
    return _ros(trial) if trial.engine == "ros" else _direct(trial)


def _direct(trial: FaultTrial) -> FaultResult:
    flight = DirectFlight(
        trial.load_scenario(),
        trial.profile,
        Vehicle.of(trial.profile.vehicle),
        trial.payload_mass,
        trial.seed,
        trial.cell.schedule,
    )
    flight.run()
    reason = flight.mission.output.abort_reason or flight.ended_by
    happened, changes = flight.fault_records, transitions(flight.mission.changes)
    return _result(trial, flight.recording.series(), reason, happened, changes)


def _ros(trial: FaultTrial) -> FaultResult:
    hindered = {one.fault.values["node"] for one in trial.cell.schedule.only(PROCESS).faults}
    settings = FlightSettings(
        scenario=trial.load_scenario(),
        profile=trial.profile,
        vehicle=trial.profile.vehicle,
        clock=trial.clock,
        payload_mass=trial.payload_mass,
        seed=trial.seed,
        scenario_source=trial.scenario,
        without=tuple(name for name in ONLOOKERS if name not in hindered),
        faults=trial.cell.schedule,
    )
    outcome = quiet.fly(settings)
    if outcome.series is None:
        broken = None if trial.cell.promise is None else False
        return FaultResult(
            trial.cell.fault, trial.cell.moment, LOST, outcome.reason, 0.0, kept=broken
        )
    return _result(trial, outcome.series, outcome.reason, outcome.faults, outcome.transitions)


def _result(
    trial: FaultTrial,
    series: Series,
    reason: str,
    happened: list[dict[str, Any]],
    changes: list[dict[str, Any]],
) -> FaultResult:
    info = {
        "payload_mass_kg": trial.payload_mass,
        "abort_reason": reason,
        "faults": happened,
        "drop_point": trial.load_scenario().drop_point,
        "transitions": changes,
    }
    figures = metrics.compute(series, info)
    outcome, promise = classify(series, figures), trial.cell.promise
    begun = min((one["begin_s"] for one in happened), default=None)
    down = None if outcome == COMPLETED or begun is None else down_after(series, begun)
    return FaultResult(
        fault=trial.cell.fault,
        moment=trial.cell.moment,
        outcome=outcome,
        why="; ".join(figures["shortfalls"]),
        duration_s=figures["duration_s"],
        down_after_s=down,
        kept=None if promise is None else promise.kept(outcome, down),
        worst=figures["max"],
        happened=tuple(happened),
    )
