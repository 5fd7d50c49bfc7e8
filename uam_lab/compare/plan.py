"""The flights of a comparison."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from uam_control.laws import catalogue
from uam_control.profiles.profile import (
    CONTROLLERS,
    Profile,
    default_profile,
    load_profile,
    profile_of,
)
from uam_lab.campaign.trial import Trial

POSITION = "position_controller"
PROPOSED = "proposed"
ASMC1, ASMC2 = catalogue.label("asmc1"), catalogue.label("asmc2")
FROZEN = "proposed, adaptation frozen"
VERBATIM, WITH_WEIGHT = "Table I verbatim", "Table I and the weight"
PAYLOADS = (0.1, 0.2, 0.3)  # [kg]


# Row names of the command line → labels: baselines, proposed law, variants of the proposed law.
ROWS = {
    **{name: law.label for name, law in catalogue.LAWS.items() if name != catalogue.DEFAULT},
    "proposed": PROPOSED,
    "frozen": FROZEN,
    "table1": VERBATIM,
    "table1_weight": WITH_WEIGHT,
}


@dataclass(frozen=True)
class ComparedController:
    """One row of the tables."""

    label: str
    profile: Profile


def entries(names: Sequence[str] = tuple(ROWS)) -> tuple[ComparedController, ...]:
    """Return the rows of these `names`, keys of ROWS."""
    proposed, verbatim = default_profile(catalogue.DEFAULT), load_profile("paper_table1")
    profiles = {
        "proposed": proposed,
        "frozen": frozen(proposed),
        "table1": verbatim,
        "table1_weight": with_weight(verbatim, proposed),
    }
    return tuple(
        ComparedController(
            ROWS[name], profiles[name] if name in profiles else default_profile(name)
        )
        for name in names
    )


def frozen(profile: Profile) -> Profile:
    """Return the profile with constant gains: the adapted gains keep their initial values."""
    sections = copy.deepcopy(profile.sections)
    for node in CONTROLLERS:
        sections[node]["adapt"] = False
    return profile_of(sections, Path(f"{profile.name}_frozen.yaml"))


def with_weight(profile: Profile, other: Profile) -> Profile:
    """Return the profile with the gravity feedforward of `other`, without which it cannot lift."""
    name = "gravity_feedforward_mass"
    sections = copy.deepcopy(profile.sections)
    sections[POSITION][name] = getattr(other.sets[POSITION], name)
    return profile_of(sections, Path(f"{profile.name}_weight.yaml"))


def middle(payloads: Sequence[float]) -> float:
    """Return the middle payload [kg], that of the flights in the figures."""
    return payloads[len(payloads) // 2]


def trials(
    rows: Sequence[ComparedController],
    payloads: Sequence[float],
    seeds: Sequence[int],
    folder: Path,
) -> list[Trial]:
    """Return the flights of every row over every payload and seed.

    The flights with the middle payload and the first seed keep their series for the figures.
    """
    shown = middle(payloads), seeds[0]
    return [
        Trial(
            row.label,
            row.profile,
            mass,
            seed,
            keep=folder / f"{number}.parquet" if (mass, seed) == shown else None,
        )
        for number, row in enumerate(rows)
        for mass in payloads
        for seed in seeds
    ]
