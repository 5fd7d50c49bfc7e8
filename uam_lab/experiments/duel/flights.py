"""A duel: the flights of each row in each scenario, what is measured of one, and its tables.

The tables are Markdown: flown (published), per row and task.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.laws import catalogue
from uam_control.mission import Scenario, load_scenario
from uam_control.mission.scenarios.hand_motion import BEFORE
from uam_control.profiles.profile import Profile, default_profile, load_profile
from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription, load_description
from uam_lab.experiments.trials.outcome import COMPLETED, Ended, classify
from uam_lab.experiments.trials.rows import Rows
from uam_lab.experiments.trials.trial import Trial, figures_of, recorded
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import phase_errors
from uam_lab.records.results.templates import markdown_table, shown
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.faults.schedule import Schedule, late, parse_spec, timed
from uam_sim_bridge.plant.effects import presets

SETTLED = 0.5  # share of a hover that counts as standing: its second half
TRIM = 0.1  # [s] of a task of the hand at each end that is not judged
MILLI, NOTHING = 1e3, float("nan")


@dataclass(frozen=True)
class Duel:
    """A duel. Figures are in the order of `report.MEASURES`, those of a pick of `PICKED`."""

    vehicle: VehicleDescription
    plant: tuple[str, ...]
    loads: dict[str, float]  # scenario → mass [kg] of the payload that it picks
    hover: str  # "" for none
    seeds: int
    delays: tuple[float, ...]  # [ms] of the setpoints, growing, each tried in the hover
    rows: dict[str, Profile]  # label → profile
    published: dict[str, dict[str, tuple[float, ...]]]  # label → scenario → figures

    @property
    def scenarios(self) -> tuple[str, ...]:
        """The tasks."""
        return tuple(self.loads)


@dataclass(frozen=True)
class DuelResult(Ended):
    """One flight: RMS errors where `judged`, of a pick those of the flight, NaN for a hover or an
    early end."""

    row: str
    scenario: str
    seed: int
    delay: float
    hand: float  # [m] end effector
    platform: float  # [m]
    heading: float  # [deg]
    joint: float  # [deg] worst joint
    standing: float  # [m] mean offset of the end effector in hover
    outcome: str  # one of `outcome.OUTCOMES`
    largest: float = NOTHING  # [m] of a pick: largest deviation of the platform in the flight
    lift: float = NOTHING  # [m] of a pick: the same around the lift
    set_down: float = NOTHING  # [m] of a pick: the same around the set-down
    rho: float = NOTHING  # of a pick: of the largest
    placed: float = NOTHING  # [m] of a pick: of the payload from its goal


ROWS = Rows(DuelResult)


def load_duel(name_or_file: str, labels: Sequence[str] = ()) -> Duel:
    """Read a duel of config/duel, or a file; labels: of the rows that fly, () for all.

    Raises ConfigurationError for a file that is not valid, ProfileError, ScenarioError.
    """
    file = configuration.named("duel", name_or_file, suffixes=(".yaml",))
    top = read_section(file, configuration.ConfigurationError)
    top.only(("vehicle", "plant", "scenarios", "hover", "seeds", "delays_ms", "rows", "published"))
    vehicle, given, published = load_description(top.text("vehicle")), top.section("rows"), {}
    for label in labels:
        if label not in given.values:
            raise given.error(label, f"no such row; there are: {', '.join(given.values)}")
    loads = {name: load_scenario(name, vehicle).payload_mass for name in top.texts("scenarios")}
    of = top.section("published") if top.has("published") else top.like({})
    for label in of.values:
        cells = of.section(label)
        cells.only(loads)
        counts = {name: 4 if loads[name] else 3 for name in cells.values}
        published[label] = {name: cells.numbers(name, count) for name, count in counts.items()}
    hover, delays = top.text("hover", default=""), ()
    if hover:
        listed = top.entry("delays_ms")
        delays = top.numbers("delays_ms", len(listed) if isinstance(listed, list) else 1)
        load_scenario(hover, vehicle)  # an invalid one is refused before any flight
    return Duel(
        vehicle,
        top.texts("plant"),
        loads,
        hover,
        top.whole("seeds", 1),
        delays,
        {label: _profile(given.section(label), vehicle) for label in labels or given.values},
        published,
    )


def _profile(entry: Section, vehicle: VehicleDescription) -> Profile:
    """Return the profile of a row: that of the law, then the files."""
    entry.only(("law", "profiles"))
    law = entry.one_of("law", catalogue.LAWS, default=catalogue.DEFAULT)
    base, files = default_profile(law, vehicle), entry.texts("profiles", default=())
    return load_profile(*files, vehicle=vehicle, onto=base.sections) if files else base


def trials(duel: Duel, seeds: int) -> Iterator[Trial]:
    """Yield every scenario and the hover with its seeds, then the hover with its delays."""
    for label, made in duel.rows.items():
        for scenario in filter(None, (*duel.scenarios, duel.hover)):
            yield from (_trial(duel, label, made, scenario, n) for n in range(1, seeds + 1))
        for delay in duel.delays:
            yield delayed(_trial(duel, label, made, duel.hover, 1), delay)


def _trial(duel: Duel, label: str, made: Profile, scenario: str, seed: int) -> Trial:
    effects = presets.added({}, presets.read(duel.plant))
    load = duel.loads.get(scenario, 0.0)
    return Trial(label, made, load, seed, scenario, effects, drawn={"delay": 0.0})


def delayed(trial: Trial, delay: float) -> Trial:
    """Return a trial whose setpoints are late by `delay` [ms].

    The delay is the law's own: no supervisor ends the flight before it.
    """
    made = trial.profile
    mission = replace(made.sets["mission"], delay_margin=1.0)
    made = replace(made, sets=made.sets | {"mission": mission})
    found = [timed(parse_spec(text), {}, "delay") for text in late(1e-3 * delay, 0.0, 0.0, 0.0)]
    late_ones = Schedule(tuple(found), trial.seed)
    return replace(trial, profile=made, faults=late_ones, drawn={"delay": delay})


def measure(trial: Trial, change: Callable[[DirectFlight], None] | None = None) -> DuelResult:
    """Fly; return the result. change: see `trial.fly`. Raises TrialFailed as `trial.recorded`."""
    outcome = recorded(trial, change)
    figures = figures_of(trial, outcome, outcome.abort_reason)
    ended, picks = classify(outcome.series, figures), bool(trial.payload_mass)
    rows = judged(outcome.series, trial.flown_scenario)
    rms = phase_errors.figures(outcome.series, rows)["rms"] if rows.any() else {}
    rms = {} if ended != COMPLETED else figures["rms"] if picks else rms
    return DuelResult(
        *(trial.label, Path(trial.scenario).stem, trial.seed, trial.drawn["delay"]),
        *(rms.get(name, NOTHING) for name in ("end_effector_norm_m", "epsilon_m")),
        rms.get("end_effector_heading_deg", NOTHING),
        max(rms["arm_deg"]) if rms else NOTHING,
        NOTHING if rms or ended != COMPLETED else standing(outcome.series),
        ended,
        *(_picked(figures) if picks and rms else ()),
    )


def _picked(figures: dict[str, Any]) -> tuple[float, ...]:
    """Return the figures of a completed pick, see `DuelResult`."""
    most, steps = figures["max"], figures["load_steps"]
    while_loading = (steps[name]["epsilon_m"] for name in ("lift", "set_down"))
    return most["epsilon_m"], *while_loading, most["rho"], figures["payload_place_error_m"]


def judged(series: Series, scenario: Scenario) -> np.ndarray:
    """Return the mask (ticks,) of the trajectory with its ramps. Of a task of the hand without what
    FSC-Lab leaves out: where the base begins before the hand and ends after it, and TRIM."""
    rows = phase_errors.with_ramps_rows(series)
    if rows.any() and scenario.route is not None and scenario.route.source is not None:
        first, last = series.time[rows][[0, -1]]
        rest = BEFORE + TRIM
        rows &= (series.time >= first + rest) & (series.time <= last - rest)
    return rows


def standing(series: Series) -> float:
    """Return the distance [m] of the mean of the end effector's error from zero, in the second half
    of the longest phase."""
    spans = {name: series.flown & series.in_phase(name) for name, _, _ in series.phase_spans()}
    rows = np.flatnonzero(max(spans.values(), key=np.sum))
    rows = rows[round(SETTLED * len(rows)) :]
    error = series.block("end_effector_error.")[rows, :3]
    return float(np.linalg.norm(np.nanmean(error, axis=0)))


Results = Sequence[DuelResult]
MEASURES: tuple[tuple[str, Callable[[DuelResult], float], int], ...] = (
    ("end effector, RMSE [mm]", lambda r: MILLI * r.hand, 1),
    ("platform, RMSE [mm]", lambda r: MILLI * r.platform, 1),
    ("heading, RMSE [deg]", lambda r: r.heading, 2),
)
# of a pick, in the order of its published figures
PICKED: tuple[tuple[str, Callable[[DuelResult], float], int], ...] = (
    *MEASURES[:2],
    ("platform, largest [mm]", lambda r: MILLI * r.largest, 0),
    ("basket off its place [mm]", lambda r: MILLI * r.placed, 1),
)
# what is not published: its largest value of all flights
LOADING: tuple[tuple[str, Callable[[DuelResult], float], int], ...] = (
    ("off its place, worst [mm]", lambda r: MILLI * r.placed, 1),
    ("platform at the lift, worst [mm]", lambda r: MILLI * r.lift, 0),
    ("at the set-down, worst [mm]", lambda r: MILLI * r.set_down, 0),
    ("rho, worst", lambda r: r.rho, 2),
)


def tables(duel: Duel, results: Results) -> str:
    """Return all tables."""
    picks = [name for name, load in duel.loads.items() if load]
    tasks = [name for name in duel.scenarios if name not in picks]
    tables = [_errors(duel, results, tasks, k) for k in range(len(MEASURES)) if tasks]
    tables += [_picks(duel, results, name) for name in picks]
    return "\n\n".join([*tables, _robust(duel, results)]) + "\n"


def mean(values: Iterable[float]) -> float:
    """Return the mean of the finite values, NaN without one."""
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else float("nan")


def _errors(duel: Duel, results: Results, tasks: Sequence[str], measure: int) -> str:
    rows = [
        [label, *(_cell(duel, results, label, task, MEASURES, measure) for task in tasks)]
        for label in dict.fromkeys((*duel.published, *duel.rows))
    ]
    return markdown_table([MEASURES[measure][0], *tasks], rows)


def _picks(duel: Duel, results: Results, task: str) -> str:
    rows = []
    for label in dict.fromkeys((*duel.published, *duel.rows)):
        own = [r for r in _of(results, label, task) if r.completed]
        cells = [_cell(duel, results, label, task, PICKED, k) for k in range(len(PICKED))]
        worst = [
            shown(max(map(value, own), default=np.nan), digits) for _, value, digits in LOADING
        ]
        rows.append([label, *cells, *worst])
    return markdown_table([task, *(head for head, *_ in (*PICKED, *LOADING))], rows)


def _cell(
    duel: Duel, results: Results, label: str, task: str, measures: Sequence[tuple], number: int
) -> str:
    """Return the mean of the completed flights, and the published figure in brackets."""
    _, value, digits = measures[number]
    said = duel.published.get(label, {}).get(task)
    told = "" if said is None else f" ({said[number]:g})"
    return shown(mean(map(value, _of(results, label, task))), digits) + told


def _robust(duel: Duel, results: Results) -> str:
    """Return worst joint, standing offset, survived delay, and ended flights of each row."""
    rows = []
    for label in duel.rows:
        own = [r for r in results if r.row == label and not r.delay]
        joint = mean(r.joint for r in own)
        offset = MILLI * mean(r.standing for r in own)
        early, lost = sum(not r.completed for r in own), sum(r.lost for r in own)
        numbers = [shown(joint, 2), shown(offset, 1), survived(results, label)]
        rows.append([label, *numbers, f"{early} of {len(own)}", str(lost)])
    head = ["row", "worst joint, RMSE [deg]", "standing offset [mm]", "survived delay [ms]"]
    return markdown_table([*head, "ended early", "lost"], rows)


def survived(results: Results, label: str) -> str:
    """Return the largest delay [ms] up to which every hover of a row was completed."""
    tried = sorted((r.delay, r.completed) for r in results if r.row == label and r.delay)
    best, end = 0.0, ""
    for delay, done in tried:
        if not done:
            break
        best = delay
    else:
        end = " or more"
    return f"{best:g}{end}" if tried else ""


def _of(results: Results, label: str, scenario: str) -> list[DuelResult]:
    return [r for r in results if (r.row, r.scenario) == (label, scenario) and not r.delay]
