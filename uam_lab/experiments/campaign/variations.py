"""Random variations of the nominal flight, for robustness statistics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.profiles.profile import Profile
from uam_control.settings.configuration import path
from uam_control.settings.section import read_section
from uam_lab.experiments.trials.trial import Trial
from uam_lab.flights.flight_options import LAST_SEED
from uam_sim_bridge.faults.schedule import Schedule, late, parse_spec, timed
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.presets import Effects

NAMES = ("payload", "payload_offset", "wind", "gust", "noise", "mass", "inertia", "efficiency")
FACTORS = ("mass", "inertia", "efficiency")  # of which 0 leaves no vehicle that flies
PER_SEED = 100_000  # numbers of flights apart from each other: seed of flight i is seed * this + i
DELAYS = ("setpoint_delay", "setpoint_jitter", "mocap_delay", "mocap_jitter")  # optional, [s]


class VariationError(ValueError):
    """The file of ranges is not usable; the text is one line."""


def ranges(file: Path | None = None) -> dict[str, tuple[float, float]]:
    """Return lowest and highest value of each variation; default: campaign/robustness.yaml.

    Raises VariationError if an entry is missing, unknown, or no pair of increasing numbers that
    are not below 0.
    """
    file = file or path("campaign/robustness.yaml")
    top = read_section(file, VariationError)
    top.only(NAMES + DELAYS)
    found = {}
    for name in (*NAMES, *filter(top.has, DELAYS)):
        found[name] = low, high = top.numbers(name, 2)
        if not 0.0 <= low <= high or (name in FACTORS and low == 0.0):
            above = "above 0" if name in FACTORS else "0 or more"
            raise top.error(name, f"[least, largest] expected, {above}: [{low:g}, {high:g}]")
    return found


@dataclass(frozen=True)
class Draws(Sequence[Trial]):
    """Random flights, drawn when looked at. Flight i depends on the seed and i, not on `total`."""

    profile: Profile
    total: int
    seed: int
    ranges: dict[str, tuple[float, float]]  # name → lowest and highest value
    scenario: str = "pick_and_place"
    effects: Effects = field(default_factory=dict)  # of the plant, in every flight

    def __post_init__(self) -> None:
        """Raise VariationError if a flight's seed would be too large."""
        if self.seed * PER_SEED + self.total - 1 > LAST_SEED:
            most = (LAST_SEED + 1 - self.total) // PER_SEED
            raise VariationError(
                f"seed {self.seed}: with {self.total} flights 0 to {most} are allowed"
            )

    def __len__(self) -> int:
        return self.total

    def __getitem__(self, number: int) -> Trial:
        """Return flight `number`. Raises IndexError."""
        if not 0 <= number < self.total:
            raise IndexError(number)
        random = np.random.default_rng([self.seed, number])
        drawn, changes = self._drawn(random)
        seed = self.seed * PER_SEED + number
        given = late(*(drawn.get(name, 0.0) for name in DELAYS))
        faults = tuple(timed(parse_spec(text), {}, "delays") for text in given)
        return Trial(
            "random",
            self.profile,
            drawn["payload"],
            seed,
            self.scenario,
            vehicle_changes=presets.added(changes, self.effects),
            faults=Schedule(faults, seed),
            drawn=drawn,
        )

    def _drawn(self, random: np.random.Generator) -> tuple[dict[str, float], dict[str, Any]]:
        """Return name → drawn value, and the changes of the plant's numbers that follow."""
        allowed = self.ranges
        drawn = {name: float(random.uniform(*allowed[name])) for name in NAMES}
        direction = random.uniform(0.0, 2.0 * np.pi)
        rotors = len(self.profile.vehicle.rotors)
        efficiency = random.uniform(*allowed["efficiency"], size=rotors)
        offset = random.uniform(0.0, 2.0 * np.pi)
        speed, away = drawn["wind"], drawn["payload_offset"]
        wind = [float(speed * np.cos(direction)), float(speed * np.sin(direction)), 0.0]
        aside = [float(away * np.cos(offset)), float(away * np.sin(offset))]
        drawn["efficiency"] = float(efficiency.min())
        drawn |= {name: float(random.uniform(*allowed[name])) for name in DELAYS if name in allowed}
        return drawn, {
            "air.wind": wind,
            "air.gust": drawn["gust"] * speed,
            "sensors.noise_scale": drawn["noise"],
            "variation.mass": drawn["mass"],
            "variation.inertia": drawn["inertia"],
            "variation.payload_offset": aside,
            "rotors.efficiency": efficiency.tolist(),
        }

    @property
    def names(self) -> tuple[str, ...]:
        return (*NAMES, *(name for name in DELAYS if name in self.ranges))

    def chosen(self, numbers: str) -> Sequence[int]:
        """Return these numbers of flights, as "3,14", counted from 0; all for "".

        Raises VariationError for another text or a number beyond the draws.
        """
        if not numbers:
            return range(self.total)
        wanted = numbers.split(",")
        if not all(one.isdecimal() and int(one) < self.total for one in wanted):
            raise VariationError(f"--draws {numbers}: numbers of 0 to {self.total - 1}, as 3,14")
        return sorted({int(one) for one in wanted})


def common(
    values: Mapping[str, np.ndarray], failed: np.ndarray
) -> list[tuple[str, float, float, float]]:
    """Compare failed and other flights: (name, mean of the failed, of the others, distance).

    values: drawn value of each flight, by name; failed: mask. distance: of the two means, in
    standard deviations over all flights; the largest comes first.
    """
    if not failed.any() or failed.all():
        return []
    found = []
    for name, drawn in values.items():
        spread = float(drawn.std())
        lost, kept = float(drawn[failed].mean()), float(drawn[~failed].mean())
        found.append((name, lost, kept, (lost - kept) / spread if spread else 0.0))
    return sorted(found, key=lambda entry: -abs(entry[3]))
