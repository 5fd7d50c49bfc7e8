"""Check of the modularity: a change of one subsystem's gains changes no other subsystem's law.

Replay: the controllers run again along a recorded flight (same states and references), with the
flown parameters and with one parameter set changed. Outputs and adapted gains of the other two
must be equal bit for bit. Flight: the vehicle also flies with the changed set, and all errors are
reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.coordinates import ATTITUDE
from uam_control.profiles.profile import Profile
from uam_lab.experiments.compare.plan import Flights
from uam_lab.experiments.trials.trial import Trial, TrialResult
from uam_lab.records.results import timeseries
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.plant.effects import presets

SUBSYSTEMS = {
    "position": ("position_controller", PositionController),
    "attitude": ("attitude_controller", AttitudeController),
    "arm": ("arm_controller", ArmController),
}
FACTOR = 0.8  # on lambda_1 and lambda_2 of the changed subsystem


@dataclass(frozen=True)
class Untouched:
    """Largest difference of output and adapted gains of each subsystem, over a replayed flight."""

    changed: str
    differences: dict[str, float]

    @property
    def holds(self) -> bool:
        """Whether only the changed subsystem differs."""
        return all((d > 0.0) == (name == self.changed) for name, d in self.differences.items())


def changed(profile: Profile, subsystem: str, factor: float = FACTOR) -> Profile:
    """Return the profile with one subsystem's feedback gains multiplied by `factor`."""
    node, _ = SUBSYSTEMS[subsystem]
    section, names = profile.section(node), ("lambda_1", "lambda_2")
    gains = {name: [factor * value for value in section[name]] for name in names}
    return profile.changed(f"{profile.name}_{subsystem}", {node: gains})


def trials(profile: Profile, flights: Flights, keep: Path) -> list[Trial]:
    """Return the unchanged flight (its series goes to `keep`) and one per changed subsystem."""
    shown = (*flights.shown, flights.scenario, presets.added({}, flights.effects))
    return [
        Trial("as it is", profile, *shown, keep=keep),
        *(
            Trial(f"{name} gains x {FACTOR:g}", changed(profile, name), *shown)
            for name in SUBSYSTEMS
        ),
    ]


def untouched(profile: Profile, series: Series, period: float) -> list[Untouched]:
    """Replay the flight with each subsystem changed in turn; period: of the control tick [s]."""
    plain = _replay(profile, series, period)
    found = []
    for name in SUBSYSTEMS:
        other = _replay(changed(profile, name), series, period)
        found.append(
            Untouched(
                name, {key: float(np.max(np.abs(plain[key] - other[key]))) for key in SUBSYSTEMS}
            )
        )
    return found


def _replay(profile: Profile, series: Series, period: float) -> dict[str, np.ndarray]:
    """Return tau and adapted gains (ticks, n) of each controller along the recorded flight."""
    rows = np.flatnonzero(series.flown)
    states = series.block("estimate.")[rows].reshape(-1, 3, series.columns.size)
    references = series.block("reference.")[rows].reshape(-1, 3, series.columns.size)
    attitude = ATTITUDE
    controllers = {name: kind(profile.sets[node]) for name, (node, kind) in SUBSYSTEMS.items()}
    out: dict[str, list[np.ndarray]] = {name: [] for name in controllers}
    for state, reference in zip(states, references, strict=True):
        desired = np.ascontiguousarray(reference[:, attitude])
        for name, controller in controllers.items():
            inputs = (True,) if name == "position" else (desired, True)
            tau = controller.update(state, reference, *inputs, period)
            out[name].append(np.concatenate([tau, controller.adaptation]))
    return {name: np.array(values) for name, values in out.items()}


@dataclass(frozen=True)
class ModularityEvidence:
    """Results of the replays and of the flights."""

    flights: tuple[TrialResult, ...]
    replays: tuple[Untouched, ...]

    @classmethod
    def of(cls, profile: Profile, series: Path, flights: Sequence[TrialResult]) -> Self:
        """Return the evidence from the recorded flight `series` and the results of `trials`."""
        flight = timeseries.read(series)
        period = float(np.median(np.diff(flight.time)))
        return cls(tuple(flights), tuple(untouched(profile, flight, period)))

    @property
    def claim(self) -> str:
        """The result as a sentence."""
        if all(replay.holds for replay in self.replays):
            return (
                "A change of one subsystem's gains changes no output and no adapted gain of the "
                "other two laws: they are equal bit for bit along the same flight."
            )
        broken = [replay.changed for replay in self.replays if not replay.holds]
        return f"A change of the gains of {', '.join(broken)} changes another subsystem's law."

    def tables(self) -> list[tuple[list[str], list[list[str]]]]:
        """Return (head, rows) of the two tables."""
        replays = [
            [
                replay.changed,
                *(f"{replay.differences[name]:.3g}" for name in SUBSYSTEMS),
                "yes" if replay.holds else "no",
            ]
            for replay in self.replays
        ]
        flights = [
            [
                flight.label,
                *(f"{value:.3g}" for value in flight.rms),
                "yes" if flight.completed else "no",
            ]
            for flight in self.flights
        ]
        return [
            (
                [
                    "changed gains of",
                    *(f"largest change of {name}" for name in SUBSYSTEMS),
                    "others unchanged",
                ],
                replays,
            ),
            (["RMS error [m, deg]", *self.flights[0].coordinates, "completed"], flights),
        ]
