"""The rows of the tables: profiles with one change at a time, and the baselines."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import yaml

from uam_control.profiles.profile import Profile, load_profile, profile_of
from uam_control.vehicle import load_description
from uam_sim_bridge.plant.effects import presets

AS_FLOWN = "paper_table1_as_flown"
FLYING = "s500"
FOLDER = Path(__file__).parent
POSITION, ARM, BRIDGE = "position_controller", "arm_controller", "mavlink_bridge"
VEHICLE, AUTOPILOT = "vehicle", "autopilot"
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


def changed(
    changes: dict[str, dict[str, Any]],
    name: str = AS_FLOWN,
    gains: dict[str, float] | None = None,
) -> Profile:
    """Return a profile with other parameters: node → name → value; gains: of the autopilot."""
    vehicle = load_description()
    vehicle = replace(vehicle, autopilot_gains=vehicle.autopilot_gains | (gains or {}))
    sections = copy.deepcopy(load_profile(name).sections)
    for node, values in changes.items():
        sections[node] = sections.get(node, {}) | values
    return profile_of(sections, Path(f"{name}_changed.yaml"), vehicle)


def as_flown() -> Row:
    """Return the row of the profile itself."""
    return Row("", "as flown, calm", load_profile(AS_FLOWN))


def flying() -> Row:
    """Return the row of the flying profile."""
    return Row("", "as it flies", load_profile(FLYING))


def fitted() -> list[Row]:
    """Return rows with the throttle scale fitted to the plant, as a laboratory does."""
    calm, lab = (changed({BRIDGE: {"throttle_per_newton": scale}}) for scale in (HOVER, LABORATORY))
    effects = presets.added({}, presets.read(["laboratory"]))
    return [
        Row("", f"{HOVER:g} per N, calm", calm),
        Row("", f"{HOVER:g} per N, calm, noise x 3", calm, {"sensors.noise_scale": 3.0}),
        Row("", f"{LABORATORY:g} per N, laboratory", lab, effects),
    ]


def one_at_a_time(file: str, profile: str) -> list[Row]:
    """Return a row per entry of a file beside this module: the profile with that change alone."""
    rows = []
    for group, readings in yaml.safe_load((FOLDER / file).read_text()).items():
        for label, changes in readings.items():
            vehicle, gains = changes.pop(VEHICLE, {}), changes.pop(AUTOPILOT, {})
            rows.append(Row(group, label, changed(changes, profile, gains), vehicle))
    return rows


def sensitivity() -> list[Row]:
    """Return the rows of `assumptions.yaml`."""
    return one_at_a_time("assumptions.yaml", AS_FLOWN)


def deviations() -> list[Row]:
    """Return the rows of `deviations.yaml`."""
    return one_at_a_time("deviations.yaml", FLYING)


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
