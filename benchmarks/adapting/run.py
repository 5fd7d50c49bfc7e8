"""The parts of a study, in order: margins of each row, varied flights, the law's own numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adapting import design
from adapting.description import NOMINAL, Condition, Row, Study
from adapting.flights import ROWS, StudyFlight, StudyResult, flights, mark, measure
from uam_control.profiles.profile import Profile, load_profile
from uam_lab.experiments.trials.experiment import Experiment
from uam_lab.experiments.workers.place import Workplace

FILE = "flown.parquet"
PROPOSED = "proposed"
SHOWN = (NOMINAL, "hard")  # conditions whose shares are shown in full


@dataclass(frozen=True)
class Margin:
    """Smallest margins of a row with its largest gains, over the loads: delay [s] and distance of
    L from -1, per loop; share: of those of the plain feedback."""

    row: str
    delay: dict[str, float]
    distance: dict[str, float]
    share: float


@dataclass(frozen=True)
class Swept:
    """One flight of a sweep: what was varied, its value, the delay margins with largest gains [s]
    of arm and setpoints, the result."""

    what: str
    value: float
    arm_delay: float
    setpoint_delay: float
    result: StudyResult


def margins(
    study: Study, rows: Sequence[Row], converged: Mapping[str, np.ndarray] | None = None
) -> list[Margin]:
    """Return the margins of the rows that have the study's feedback.

    converged: gains of the row that is frozen as converged, see `Runner.converged`.
    """
    strength, loads = study.document["strengths"], study.document["margin_loads"]
    plain_row = Row("", design.MODULAR, "zero")
    plain = {m: design.loop_margins(design.profile(study, plain_row, {}), m) for m in loads}
    found = []
    for row in rows:
        made = design.profile(study, row, strength, converged)
        at = {m: design.loop_margins(made, m, design.largest_gains(made)) for m in loads}
        found.append(
            Margin(
                row.label,
                {k: min(one.delay[k] for one in at.values()) for k in plain[loads[0]].delay},
                {k: min(one.distance[k] for one in at.values()) for k in plain[loads[0]].distance},
                min(at[m].share_of(plain[m]) for m in loads),
            )
        )
    return found


class Runner:
    """Flies the parts of a study into a folder; results of earlier runs are used again."""

    def __init__(
        self,
        study: Study,
        out: Path,
        place: Workplace,
        seeds: int,
        engine: str = "direct",
    ) -> None:
        """engine: of all flights."""
        self.study, self._out, self._engine = study, out, engine
        # the key of each row has all inputs of its flight
        of = {"rows": "of studies"}
        self._flown = Experiment("study", out / FILE, ROWS, of, place, measure)
        self.seeds = tuple(range(1, seeds + 1))
        self.strength = study.document["strengths"]

    def _fly(self, planned: list[StudyFlight]) -> list[StudyResult]:
        chosen = [replace(one, engine=self._engine) for one in planned]
        marks = list(map(mark, chosen))
        results = self._flown.fly(marks, dict(zip(marks, chosen, strict=True)).__getitem__, _about)
        return [results[one] for one in marks]

    def _planned(
        self, made: dict[str, Profile], conditions: Sequence[Condition]
    ) -> list[StudyFlight]:
        return flights(self.study, made, conditions, self.seeds, self._out / "scenarios")

    def varied(self, labels: Sequence[str] = ()) -> list[StudyResult]:
        """Fly every row in every condition, or in those of these labels only."""
        study, gains = self.study, self.converged()
        planned = []
        for row in study.rows:
            made = {row.label: design.profile(study, row, self.strength, gains)}
            allowed = (row.conditions, labels)
            chosen = [
                one for one in study.conditions if all(not a or one.label in a for a in allowed)
            ]
            planned += self._planned(made, chosen)
        return self._fly(planned)

    def converged(self) -> dict[str, np.ndarray]:
        """Fly `proposed` in the nominal condition; return subsystem → mean of K0..K3, zeta."""
        nominal = [self.study.condition(NOMINAL)]
        made, folder = {PROPOSED: self._made(PROPOSED)}, self._out / "scenarios"
        flown = self._fly(flights(self.study, made, nominal, [1], folder))[0]
        return {name: np.array(values[:5]) for name, values in flown.gains.items()}

    def _made(self, label: str, study: Study | None = None) -> Profile:
        study = study or self.study
        row = next(one for one in study.rows if one.label == label)
        return design.profile(study, row, self.strength)

    def law_sweep(self) -> list[Swept]:
        """Vary the boundary layer, nu and the delay of the setpoints, one at a time.

        The ceilings of K stay as they are: a thinner layer is a larger gain.
        """
        study, entry = self.study, self.study.document["law_sweep"]
        shown = [study.condition(label) for label in entry["conditions"]]
        planned, values = [], []
        for what in ("layer", "nu", "delay"):
            for value in entry[what]:
                made = self._changed(what, float(value))
                delay = 1e-3 * value if what == "delay" else 0.0
                label = f"{what} {value:g}"
                some = flights(study, {label: made}, shown, [1], self._out / "scenarios", delay)
                margin = design.loop_margins(made, 0.0, design.largest_gains(made))
                planned += some
                values += [(what, float(value), margin)] * len(some)
        return [
            Swept(what, value, *_delays(margin), result)
            for (what, value, margin), result in zip(values, self._fly(planned), strict=True)
        ]

    def _changed(self, what: str, factor: float) -> Profile:
        """Return the proposed row with layer or nu times a factor, everything else as it is."""
        made = self._made(PROPOSED)
        if what == "delay":
            return made
        sections = {node: dict(values) for node, values in made.sections.items()}
        for node in (f"{name}_controller" for name in design.SUBSYSTEMS):
            section = sections[node]
            if what == "layer":
                section["varpi"] = section["varpi"] * factor
            else:
                section["nu"] = [factor * nu for nu in section["nu"]]
        return design.profile_of(sections, made.file, made.vehicle)

    def arm_sweep(self) -> list[Swept]:
        """Vary the arm's bandwidth in a mission; position and attitude are those of a profile."""
        study, entry = self.study, self.study.document["arm_sweep"]
        base = load_profile(entry["profile"], vehicle=study.vehicle)
        made = [(f"{entry['profile']} as it is", 1.0, base)]
        for label in entry["rows"]:
            for factor in entry["bandwidth"]:
                arm = self._made(label, _faster_arm(study, factor)).sections["arm_controller"]
                sections = base.sections | {"arm_controller": arm}
                changed = design.profile_of(sections, base.file, base.vehicle)
                made.append((label, float(factor), changed))
        planned = []
        for label, factor, one in made:
            name = f"{label}, arm x {factor:g}"
            scenario = entry["scenario"]
            trial = StudyFlight(name, one, entry["payload"], 1, scenario, condition=scenario)
            planned.append(trial)
        found = zip(made, self._fly(planned), strict=True)
        return [
            Swept(label, factor, *_delays(design.loop_margins(one, 0.0, _arm_gains(one))), result)
            for (label, factor, one), result in found
        ]


def _about(result: StudyResult) -> str:
    return f"{result.row}, {result.condition}, seed {result.seed}"


def _faster_arm(study: Study, factor: float) -> Study:
    """Return the study with the bandwidth of the arm's feedback times a factor."""
    feedback = study.document["feedback"]
    arm = feedback["arm"] | {"bandwidth": [factor * w for w in feedback["arm"]["bandwidth"]]}
    document = study.document | {"feedback": feedback | {"arm": arm}}
    return replace(study, document=document)


def _arm_gains(made: Profile) -> dict[str, np.ndarray]:
    """Return the arm's largest gains; those of position and attitude stay at their start."""
    return {name: g for name, g in design.largest_gains(made).items() if name == "arm"}


def _delays(margin: design.LoopMargins) -> tuple[float, float]:
    if not margin.stable:
        return 0.0, 0.0
    arm = min(v for k, v in margin.delay.items() if k.startswith("alpha"))
    return arm, margin.delay["setpoints"]
