"""Check of the modularity: a change of one subsystem's gains changes no other subsystem's law.

Replay: the controllers run again along a recorded flight (same states and references), with the
flown parameters and with one parameter set changed. Outputs and adapted gains of the other two
must be equal bit for bit. Flight: the vehicle also flies with the changed set, and all errors are
reported.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

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


Table = tuple[list[str], list[list[str]]]  # head, rows
# changed subsystem → subsystem → largest difference of output and adapted gains, over a replay
Replays = Mapping[str, Mapping[str, float]]


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


def replays(profile: Profile, series: Series, period: float) -> Replays:
    """Replay the flight with each subsystem changed in turn; period: of the control tick [s]."""
    plain = _replay(profile, series, period)
    found = {}
    for name in SUBSYSTEMS:
        other = _replay(changed(profile, name), series, period)
        found[name] = {k: float(np.max(np.abs(plain[k] - other[k]))) for k in SUBSYSTEMS}
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


def evidence(
    profile: Profile, kept: Path, flights: Sequence[TrialResult]
) -> tuple[str, list[Table]]:
    """Return the result as a sentence, and its two tables.

    kept: series of the unchanged flight; flights: results of `trials`.
    """
    flight = timeseries.read(kept)
    found = replays(profile, flight, float(np.median(np.diff(flight.time))))
    return claim(found), tables(found, flights)


def holds(name: str, differences: Mapping[str, float]) -> bool:
    """Return whether only the changed subsystem `name` differs."""
    return all((d > 0.0) == (other == name) for other, d in differences.items())


def claim(found: Replays) -> str:
    """Return the result as a sentence."""
    if broken := [name for name, differences in found.items() if not holds(name, differences)]:
        return f"A change of the gains of {', '.join(broken)} changes another subsystem's law."
    return (
        "A change of one subsystem's gains changes no output and no adapted gain of the other two "
        "laws: they are equal bit for bit along the same flight."
    )


def tables(found: Replays, flights: Sequence[TrialResult]) -> list[Table]:
    """Return the tables of the replays and of the flights."""
    largest = [f"largest change of {name}" for name in SUBSYSTEMS]
    replayed = [
        [name, *(f"{d:.3g}" for d in one.values()), "yes" if holds(name, one) else "no"]
        for name, one in found.items()
    ]
    flown = [
        [one.label, *(f"{value:.3g}" for value in one.rms), "yes" if one.completed else "no"]
        for one in flights
    ]
    return [
        (["changed gains of", *largest, "others unchanged"], replayed),
        (["RMS error [m, deg]", *flights[0].coordinates, "completed"], flown),
    ]
