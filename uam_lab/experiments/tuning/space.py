"""Search space from a file of config/tuning: parameters with ranges, flights, cost function."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

from uam_control.laws import catalogue
from uam_control.profiles.profile import NODES, Profile, default_profile
from uam_control.settings import configuration
from uam_control.settings.parameter_set import TINY, Bound, ParameterSet
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription
from uam_lab.experiments.trials.trial import Trial, TrialResult, feasible
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.presets import Effects

DIGITS = 4  # significant digits of a value


class TuningError(ValueError):
    """An invalid search space or a failed search; the text is one line."""


@dataclass(frozen=True)
class Knob:
    """One variable of the search: entries of a parameter with one common value, in log scale."""

    nodes: tuple[str, ...]  # those whose parameter is set, usually one
    parameter: str
    low: float
    high: float
    entries: tuple[int, ...] = ()  # () for a scalar parameter

    @property
    def name(self) -> str:
        """Name of the variable, as "arm_controller.lambda_1[0]"."""
        where = ",".join(map(str, self.entries))
        node = self.nodes[0] if len(self.nodes) == 1 else "all"
        return f"{node}.{self.parameter}" + (f"[{where}]" if where else "")

    def value(self, profile: Profile) -> float:
        """Return the value in a profile (first entry), limited to the range."""
        value = getattr(profile.sets[self.nodes[0]], self.parameter)
        value = value[self.entries[0]] if self.entries else value
        return min(max(float(value), self.low), self.high)


@dataclass(frozen=True)
class Cost:
    """The cost function; its formula is in config/tuning/modular.yaml."""

    aim: tuple[float, ...]
    peak_weight: float
    restless_weight: float
    restless_allowed: tuple[float, float]
    not_completed: float
    lost: float

    def of(self, result: TrialResult) -> float:
        """Return the cost of a flight, always finite."""
        if result.cut_short or not all(map(math.isfinite, result.rms)):
            return self.lost * (2.0 - result.flown)
        share = [(value / aim) ** 2 for value, aim in zip(result.rms, self.aim, strict=True)]
        peak = [
            (value / (5.0 * aim)) ** 2 for value, aim in zip(result.largest, self.aim, strict=True)
        ]
        restless = [
            (value / allowed) ** 2
            for value, allowed in zip(result.restless, self.restless_allowed, strict=True)
        ]
        return (
            sum(share) / len(share)
            + self.peak_weight * sum(peak) / len(peak)
            + self.restless_weight * sum(restless)
            + (0.0 if result.completed else self.not_completed)
        )


@dataclass(frozen=True)
class Space:
    """A search: start profile, knobs, flights of an evaluation, cost.
    With a `delay_margin` that of the setpoint path is a second objective, and the best profile is
    that of least cost with at least this margin."""

    name: str
    start: Profile
    knobs: tuple[Knob, ...]
    flights: tuple[dict[str, Any], ...]
    cost: Cost
    delay_margin: float | None = None  # [s]; None: the cost alone

    @property
    def start_values(self) -> dict[str, float]:
        """Values of the start profile by name of the knob."""
        return {knob.name: knob.value(self.start) for knob in self.knobs}

    def profile(self, values: Mapping[str, float], name: str = "candidate") -> Profile:
        """Return the start profile with the knobs at `values` (by name). Raises ProfileError."""
        changes: dict[str, dict[str, Any]] = {}
        for knob, node in [(k, node) for k in self.knobs for node in k.nodes]:
            value = float(f"{values[knob.name]:.{DIGITS}g}")
            section = changes.setdefault(node, {})
            if not knob.entries:
                section[knob.parameter] = value
                continue
            vector = list(
                section.get(knob.parameter) or getattr(self.start.sets[node], knob.parameter)
            )
            for entry in knob.entries:
                vector[entry] = value
            section[knob.parameter] = vector
        return self.start.changed(name, changes)

    def with_effects(self, effects: Effects) -> Self:
        """Return the space with these effects of the plant in every flight that has none."""
        flights = ({**flight, "effects": flight["effects"] or effects} for flight in self.flights)
        return replace(self, flights=tuple(flights))

    def trials(self, profile: Profile) -> list[Trial]:
        return [
            Trial(
                self.name,
                profile,
                flight["payload_mass"],
                flight["seed"],
                flight.get("scenario", "pick_and_place"),
                vehicle_changes=presets.added(flight.get("vehicle", {}), flight["effects"]),
            )
            for flight in self.flights
        ]


def load_space(
    name_or_file: str, start: Profile | None = None, vehicle: VehicleDescription | None = None
) -> Space:
    """Read a file of config/tuning, or another one.

    start: None for the vehicle's profile of the file's law; vehicle: None for the default one.
    Raises TuningError, ProfileError, ScenarioError, ConfigurationError; one line each.
    """
    file = configuration.named("tuning", name_or_file)
    top = read_section(file, TuningError)
    if top.has("judged_as"):  # flights and cost of another space, for a fair comparison
        other = configuration.named("tuning", top.text("judged_as"))
        top.values = {**read_section(other, TuningError).values, **top.values}
    law = top.one_of("controller", catalogue.LAWS)
    start = start or default_profile(law, vehicle)
    two = top.has("delay_margin")
    space = Space(
        file.stem,
        start,
        tuple(_knob(entry, start) for entry in top.entries("knobs")),
        tuple(map(_flight, top.entries("flights"))),
        _cost(top.section("cost"), len(start.vehicle.coordinates)),
        top.section("delay_margin").number("at_least") if two else None,
    )
    top.only_asked()
    if len(space.start_values) < len(space.knobs):
        raise TuningError(f"{file}: knobs: the same entries of a parameter twice")
    for scenario in {trial.scenario for trial in space.trials(start)}:
        feasible(scenario, start)
    return space


def _flight(entry: Section) -> dict[str, Any]:
    names = filter(entry.has, ("scenario", "plant_preset"))
    given: dict[str, Any] = {name: entry.text(name) for name in sorted(names)}
    if entry.has("vehicle") and entry.values["vehicle"]:
        given["vehicle"] = entry.mapping("vehicle")
    return {
        **given,
        "payload_mass": entry.not_negative("payload_mass"),
        "seed": entry.whole("seed"),
        "effects": presets.read([given.get("plant_preset", presets.CALM)]),
    }


def _cost(entry: Section, coordinates: int) -> Cost:
    names = [field.name for field in fields(Cost)]
    entry.only(names)
    counts = {"aim": coordinates, "restless_allowed": 2}
    values = {
        name: entry.numbers(name, counts[name]) if name in counts else entry.not_negative(name)
        for name in names
    }
    for name in counts:
        if min(values[name]) <= 0.0:
            raise entry.error(name, f"{min(values[name]):g} is not above 0")
    return Cost(**values)


def _knob(entry: Section, start: Profile) -> Knob:
    entry.only(("node", "nodes", "parameter", "entries", "low", "high"))
    nodes = entry.texts("nodes", default=()) or (entry.text("node"),)
    entries = entry.values.get("entries", [])
    if not isinstance(entries, list) or not all(type(one) is int for one in entries):
        raise entry.error("entries", f"a list of 0, 1, 2, .. expected, got {entries!r}")
    low, high = entry.number("low"), entry.number("high")
    knob = Knob(nodes, entry.text("parameter"), low, high, tuple(entries))
    for node in nodes:
        if node not in NODES:
            raise TuningError(f"{knob.name}: no such node; there are: {', '.join(NODES)}")
        _check(knob, start.sets[node])
    return knob


def _check(knob: Knob, values: ParameterSet) -> None:
    """Raise TuningError if the knob does not fit its parameter of a node's `values`."""
    spec = values.specs().get(knob.parameter)
    if not isinstance(spec, Bound) or spec.whole:
        raise TuningError(f"{knob.name}: no such parameter, or no real number")
    if not max(spec.low, TINY) <= knob.low < knob.high <= spec.high:
        raise TuningError(f"{knob.name}: low < high are expected, above 0, within {spec.allowed}")
    value = getattr(values, knob.parameter)
    length = len(value) if isinstance(value, tuple) else 0
    if bool(length) != bool(knob.entries) or any(not 0 <= i < length for i in knob.entries):
        raise TuningError(
            f"{knob.name}: entries 0 to {length - 1} are expected"
            if length
            else f"{knob.name}: the parameter is one number, entries are not allowed"
        )
