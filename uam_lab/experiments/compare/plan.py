"""The flights of a comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from uam_control.laws import catalogue
from uam_control.profiles.profile import Profile, default_profile, load_profile
from uam_control.vehicle import VehicleDescription
from uam_lab.experiments.trials.trial import Trial
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.presets import Effects

POSITION = "position_controller"
PROPOSED = "proposed"
ASMC1, ASMC2 = catalogue.label("asmc1"), catalogue.label("asmc2")
FROZEN = "proposed, adaptation frozen"
VERBATIM, WITH_WEIGHT = "Table I verbatim", "Table I and the weight"
FLOWN = "Table I as probably flown"
PAYLOADS = (0.1, 0.2, 0.3)  # [kg]
PX4_POSITION, PX4_PROFILE = "PX4's position control", "px4_position"  # label, profile
TABLE1, TABLE1_FLOWN = "paper_table1", "paper_table1_as_flown"  # profiles


# Row names of the command line → labels: baselines, proposed law, variants of the proposed law.
ROWS = {
    **{name: catalogue.label(name) for name in catalogue.LAWS if name != catalogue.DEFAULT},
    "proposed": PROPOSED,
    "frozen": FROZEN,
    **{f"frozen_{name}": f"proposed, {name} frozen" for name in SUBSYSTEMS},
    "table1": VERBATIM,
    "table1_weight": WITH_WEIGHT,
    "table1_flown": FLOWN,
    "px4_position": PX4_POSITION,
}


@dataclass(frozen=True)
class Flights:
    """The flights of every row: each payload [kg] with each seed."""

    vehicle: VehicleDescription
    scenario: str
    payloads: tuple[float, ...]
    seeds: tuple[int, ...]
    engine: str = "direct"
    effects: Effects = field(default_factory=dict)  # of the plant

    @property
    def shown(self) -> tuple[float, int]:
        """Payload [kg] and seed of the flights in the figures: the middle and the first one."""
        return self.payloads[len(self.payloads) // 2], self.seeds[0]


def entries(
    names: Sequence[str] = tuple(ROWS), vehicle: VehicleDescription | None = None
) -> dict[str, Profile]:
    """Return the rows of these `names`, keys of ROWS: label → profile; vehicle: None for the
    default one.

    Raises ProfileError for a profile that does not fit the vehicle.
    """
    proposed = default_profile(catalogue.DEFAULT, vehicle)
    variants = {
        "proposed": lambda: proposed,
        "frozen": lambda: frozen(proposed),
        **{f"frozen_{name}": partial(frozen, proposed, (name,)) for name in SUBSYSTEMS},
        "table1": lambda: load_profile(TABLE1, vehicle=vehicle),
        "table1_flown": lambda: load_profile(TABLE1_FLOWN, vehicle=vehicle),
        "px4_position": lambda: load_profile(str(proposed.file), PX4_PROFILE, vehicle=vehicle),
        "table1_weight": lambda: with_weight(load_profile(TABLE1, vehicle=vehicle), proposed),
    }
    return {
        ROWS[name]: variants[name]() if name in variants else default_profile(name, vehicle)
        for name in names
    }


def frozen(profile: Profile, subsystems: Sequence[str] = SUBSYSTEMS) -> Profile:
    """Return the profile with constant gains: the adapted gains of these `subsystems` keep their
    initial values, theta_hat is zero."""
    adapt = {f"{name}_controller": {"adapt": False} for name in subsystems}
    return profile.changed(f"{profile.name}_frozen", adapt)


def with_weight(profile: Profile, other: Profile) -> Profile:
    """Return the profile with the gravity feedforward of `other`, without which it cannot lift."""
    name = "gravity_feedforward_mass"
    weight = {POSITION: {name: getattr(other.sets[POSITION], name)}}
    return profile.changed(f"{profile.name}_weight", weight)


def trials(rows: Mapping[str, Profile], flights: Flights, folder: Path) -> list[Trial]:
    """Return the flights of every row; those of the figures keep their series in `folder`."""
    return [
        Trial(
            label,
            profile,
            mass,
            seed,
            flights.scenario,
            keep=folder / f"{number}.parquet" if (mass, seed) == flights.shown else None,
            engine=flights.engine,
            vehicle_changes=presets.added({}, flights.effects),
        )
        for number, (label, profile) in enumerate(rows.items())
        for mass in flights.payloads
        for seed in flights.seeds
    ]
