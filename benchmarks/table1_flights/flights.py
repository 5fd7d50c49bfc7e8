"""The rows of the tables: profiles with other readings of an assumption, and the baselines."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import yaml

from uam_control.profiles.profile import Profile, load_profile, profile_of
from uam_sim_bridge.plant.effects import presets

AS_FLOWN = "paper_table1_as_flown"
ASSUMPTIONS = Path(__file__).with_name("assumptions.yaml")
POSITION, ARM, BRIDGE = "position_controller", "arm_controller", "mavlink_bridge"
VEHICLE = "vehicle"
# of the search: every combination, with the throttle scale of hover
FORMS = ("theory", "table", "sliding")
BANDWIDTHS = (12.0, 32.0)  # [rad/s] of the estimator's position
NOISES = (1.0, 3.0, 6.0)
HOVER = 0.0606  # [1/N] of the calm plant
LABORATORY = 0.064  # [1/N] of the preset `laboratory`, whose battery is not full


@dataclass(frozen=True)
class Row:
    """One row: what is assumed otherwise, profile and changes of the vehicle."""

    group: str
    label: str
    profile: Profile
    vehicle: dict[str, Any] = field(default_factory=dict)


def changed(changes: dict[str, dict[str, Any]], *names: str) -> Profile:
    """Return a profile (default: AS_FLOWN) with other parameters: node → name → value."""
    profile = load_profile(*(names or (AS_FLOWN,)))
    sections = copy.deepcopy(profile.sections)
    for node, values in changes.items():
        sections[node] = sections.get(node, {}) | values
    return profile_of(sections, Path(f"{profile.name}_changed.yaml"), profile.vehicle)


def as_flown() -> Row:
    """Return the row of the profile itself."""
    return Row("", "as flown, calm", load_profile(AS_FLOWN))


def fitted() -> list[Row]:
    """Return rows with the throttle scale fitted to the plant, as a laboratory does."""
    calm, lab = (changed({BRIDGE: {"throttle_per_newton": scale}}) for scale in (HOVER, LABORATORY))
    effects = presets.added({}, presets.read(["laboratory"]))
    return [
        Row("", f"{HOVER:g} per N, calm", calm),
        Row("", f"{HOVER:g} per N, calm, noise x 3", calm, {"sensors.noise_scale": 3.0}),
        Row("", f"{LABORATORY:g} per N, laboratory", lab, effects),
    ]


def sensitivity() -> list[Row]:
    """Return a row per reading in `assumptions.yaml`, each with one assumption changed."""
    rows = []
    for group, readings in yaml.safe_load(ASSUMPTIONS.read_text()).items():
        for label, changes in readings.items():
            vehicle = changes.pop(VEHICLE, {})
            rows.append(Row(group, label, changed(changes), vehicle))
    return rows


def search() -> list[Row]:
    """Return a row for each combination of reading of Lambda, bandwidth and noise."""
    rows = []
    for form, bandwidth, noise in product(FORMS, BANDWIDTHS, NOISES):
        profile = changed({
            POSITION: {"lambda_form": form},
            BRIDGE: {"throttle_per_newton": HOVER},
            "state_estimator": {"position_bandwidth": bandwidth},
        })  # fmt: skip
        label = f"{form}, {bandwidth:g} rad/s, noise x {noise:g}"
        rows.append(Row("search", label, profile, {"sensors.noise_scale": noise}))
    return rows


def baselines() -> list[Row]:
    """Return the reconstructed baselines in the same reading; their published gains are unknown.

    Their tau_p is the force on the vehicle's mass: the throttle per newton is smaller by it.
    """
    own = load_profile(AS_FLOWN).sections
    rows = []
    for name, label in (("asmc1", "ASMC-1"), ("asmc2", "ASMC-2")):
        mass = load_profile(name).sets[POSITION].gravity_feedforward_mass
        shared = {
            POSITION: {"attitude_cutoff": own[POSITION]["attitude_cutoff"]},
            ARM: {
                k: own[ARM][k] for k in ("setpoint", "goal_from", "goal_compliance", "goal_rate")
            },
            BRIDGE: own[BRIDGE]
            | {"throttle_per_newton": own[BRIDGE]["throttle_per_newton"] / mass},
        }
        rows.append(Row("baseline", f"{label}, gains tuned here", changed(shared, name)))
        if name == "asmc1":
            start = {"damping": [5.0] * 3, "switching": [4.0] * 3, "gamma": 5.0}
            sections = copy.deepcopy(shared)
            sections[POSITION] |= start
            rows.append(Row("baseline", f"{label}, start values", changed(sections, name)))
    return rows
