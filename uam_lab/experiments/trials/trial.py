"""One flight of an experiment, in either engine, and its result."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.coordinates import ALPHA, coordinates
from uam_control.mission import Feasibility, Scenario, load_scenario
from uam_control.profiles.profile import Profile
from uam_lab.experiments.trials.carried import Carried
from uam_lab.experiments.trials.outcome import Ended, classify, explained
from uam_lab.experiments.trials.rows import Rows
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.flights.flight_options import ONLOOKERS
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.interrupts import Interrupts
from uam_lab.records.results import metrics
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.phase_errors import GROUPS
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.faults import PROCESS, Schedule
from uam_sim_bridge.plant import Vehicle


class TrialFailed(RuntimeError):
    """The flight ended with a failure; the text is one line."""


@dataclass(frozen=True)
class Trial:
    """One flight of the profile's vehicle."""

    label: str  # its row in the tables
    profile: Profile
    payload_mass: float  # [kg]
    seed: int
    scenario: str = "pick_and_place"  # name or file
    vehicle_changes: dict[str, object] = field(default_factory=dict)
    keep: Path | None = None  # file for its time series, if any
    faults: Schedule = Schedule()
    engine: str = "direct"
    clock: str = "lockstep"
    carried: Carried | None = None  # for a worker without this machine's files
    drawn: dict[str, float] = field(default_factory=dict)  # name → value drawn at random

    @cached_property
    def flown_scenario(self) -> Scenario:
        """The scenario as `uam fly` flies it; it is read once. Raises ScenarioError."""
        if self.carried is not None and self.carried.scenario is not None:
            read = self.carried.scenario
        else:
            read = load_scenario(self.scenario, self.profile.vehicle)
        return _limits(read, self.profile).fitted(read)

    def settings(self, **more: Any) -> FlightSettings:
        """Return the settings of the flight for an engine of `uam fly`; more: further ones."""
        return FlightSettings(
            scenario=self.flown_scenario,
            profile=self.profile,
            vehicle=self.profile.vehicle,
            clock=self.clock,
            payload_mass=self.payload_mass,
            seed=self.seed,
            scenario_source=self.scenario,
            vehicle_changes=self.vehicle_changes,
            faults=self.faults,
            **more,
        )


@dataclass(frozen=True)
class TrialResult(Ended):
    """Result of a flight. rms, largest: errors of the `coordinates`, NaN without a take-off."""

    label: str
    payload_mass: float
    seed: int
    rms: np.ndarray  # (6 + n,) [m, deg]
    largest: np.ndarray  # (6 + n,) [m, deg]
    flown: float  # flown time / planned time
    cut_short: bool  # not landed by the mission
    outcome: str  # one of `outcome.OUTCOMES`
    why: str  # see `outcome.explained`
    place_error: float | None
    restless: tuple[float, float]  # RMS change a tick: rate setpoints [rad/s], joint torques [N m]
    peaks: dict[str, float]  # the largest value of each adaptation column
    drawn: dict[str, float] = field(default_factory=dict)  # as in the trial

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the entries of rms and largest."""
        return coordinates(len(self.rms) - ALPHA)


def feasible(name: str, profile: Profile) -> Scenario:
    """Return the scenario `name` (or file) of flights with this profile, before any is flown.

    Raises ScenarioError; InfeasibleReference if it exceeds a limit, as `uam fly`.
    """
    found = load_scenario(name, profile.vehicle)
    limits = _limits(found, profile)
    limits.check(limits.fitted(found))
    return found


def _limits(scenario: Scenario, profile: Profile) -> Feasibility:
    return Feasibility(profile.vehicle, profile.sets["mission"], scenario.payload_mass)


def fly(trial: Trial, change: Callable[[DirectFlight], None] | None = None) -> Outcome:
    """Fly a trial, without log and output; change: called with the flight, if that is direct.

    Raises ConfigurationError, ScenarioError.
    """
    scenario = trial.flown_scenario
    if trial.engine == "ros":
        return _fly_nodes(trial)
    vehicle = Vehicle.of(trial.profile.vehicle).changed(trial.vehicle_changes)
    flight = DirectFlight(
        scenario, trial.profile, vehicle, trial.payload_mass, trial.seed, trial.faults
    )
    if change is not None:
        change(flight)
    flight.run()
    return flight.outcome({"controller": trial.label})


def _fly_nodes(trial: Trial) -> Outcome:
    """Fly a trial with nodes, topics and MAVLink, as `uam fly` does.

    Ctrl-C ends the flight in order and is then raised as KeyboardInterrupt.
    """
    from uam_lab.flights.ros import engine

    needed = {one.fault.to_mapping()["node"] for one in trial.faults.only(PROCESS).faults}
    left_out = tuple(name for name in ONLOOKERS if name not in needed)
    settings = trial.settings(without=left_out)
    prepare()
    with tempfile.TemporaryDirectory(prefix="uam-flight-") as folder, Interrupts() as stop:
        outcome = engine.fly(settings, ResultFolder(Path(folder)), Observer(), stop)
    if stop.raised:
        raise KeyboardInterrupt
    if outcome.series is not None:
        outcome.series.info["controller"] = trial.label
    return outcome


def recorded(trial: Trial, change: Callable[[DirectFlight], None] | None = None) -> Outcome:
    """Fly a trial, as `fly`; return its outcome, which has a series.

    Raises TrialFailed if nothing was recorded, or if a flight with the nodes failed.
    """
    outcome = fly(trial, change)
    if outcome.series is None or (trial.engine == "ros" and outcome.partial):
        raise TrialFailed(
            f"{trial.label}, {trial.payload_mass:g} kg, seed {trial.seed}: "
            f"{outcome.reason or 'nothing was recorded'}"
        )
    return outcome


def figures_of(trial: Trial, outcome: Outcome, abort_reason: str) -> dict[str, Any]:
    """Return the content of metrics.json for a flight with a recorded series."""
    scenario = trial.flown_scenario
    info = {
        "payload_mass_kg": trial.payload_mass,
        "drop_point": scenario.drop_point,
        "landing_point": scenario.landing_point,
        "abort_reason": abort_reason,
        "transitions": outcome.transitions,
        "grasps": outcome.grasps,
        "faults": outcome.faults,
    }
    return metrics.compute(outcome.series, info)


def measure(trial: Trial) -> TrialResult:
    """Fly a trial; return its result and write its series to `trial.keep` if given.

    Raises TrialFailed as `recorded`.
    """
    outcome = recorded(trial)
    series = outcome.series
    if trial.keep is not None:
        series.write(trial.keep)
    figures = figures_of(trial, outcome, outcome.reason)
    flown, landing = series.flown, trial.flown_scenario.landing
    end = classify(series, figures)
    return TrialResult(
        label=trial.label,
        payload_mass=trial.payload_mass,
        seed=trial.seed,
        rms=_row(figures["rms"]),
        largest=_row(figures["max"]),
        flown=min(1.0, figures["duration_s"] / (landing.end)),
        cut_short=not bool(series.in_phase("landed").any()),
        outcome=end,
        why=explained(end, figures),
        place_error=figures["payload_place_error_m"],
        restless=(_change(_rates(series)[flown]), _change(series.block("tau_alpha.")[flown])),
        peaks=_peaks(series, flown),
        drawn=trial.drawn,
    )


def result_rows(joints: int, drawn: Sequence[str] = ()) -> Rows:
    """Return the rows of results, for a vehicle with so many joints; drawn: names of the values."""
    names = coordinates(joints)
    parts = {"drawn": drawn, "rms": names, "largest": names, "restless": ("rates", "torques")}
    return Rows(TrialResult, parts)


def _row(groups: dict[str, list[float | None]]) -> np.ndarray:
    values = [value for key, _, _ in GROUPS for value in groups[key]]
    return np.array([np.nan if value is None else value for value in values])


def _rates(series: Series) -> np.ndarray:
    """Body rates (ticks, 3) [rad/s] that were sent; those of the vehicle where none were."""
    sent = series.block("setpoint.rate_")
    own = np.column_stack([series[f"truth.{axis}_dot"] for axis in ("roll", "pitch", "yaw")])
    return own if np.isnan(sent).all() else sent


def _change(values: np.ndarray) -> float:
    """Return the RMS change of values (ticks, n) per tick, over all columns; 0 for one tick."""
    return float(np.sqrt(np.mean(np.square(np.diff(values, axis=0))))) if len(values) > 1 else 0.0


def _peaks(series: Series, flown: np.ndarray) -> dict[str, float]:
    where = series.columns.block("adaptation.")
    values = np.abs(series.values[flown, where])
    return {
        name.removeprefix("adaptation."): float(np.nanmax(column))
        for name, column in zip(series.columns.names[where], values.T, strict=True)
        if not np.isnan(column).all()
    }
