"""Profiles: ROS parameter files that hold the parameters of every node of a flight.

    position_controller:
      ros__parameters:
        inertia: [2.2, 2.2, 2.2]
        ...

A profile is read whole and checked whole; the same sets go to the nodes and to the direct engine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from uam_control import configuration
from uam_control.controllers import POSITION_SETS, TORQUE_SETS
from uam_control.estimation import EstimatorParameters
from uam_control.laws import catalogue
from uam_control.mission import MissionParameters
from uam_control.parameters import ParameterError, ParameterSet

# controller → (law → parameter set, axes of its per-axis vectors)
CONTROLLERS: dict[str, tuple[dict[str, type[ParameterSet]], int]] = {
    "position_controller": (POSITION_SETS, 3),
    "attitude_controller": (TORQUE_SETS, 3),
    "arm_controller": (TORQUE_SETS, 2),
}
OTHERS = {"state_estimator": EstimatorParameters, "mission": MissionParameters}
NODES = (*CONTROLLERS, *OTHERS)
# Parameters that a file may hold but that are no part of a profile: of ROS itself, and those that
# the effective parameters of a flight have besides.
ROS_OWN = ("use_sim_time",)
FLIGHT_OWN = {"mission": ("scenario",)}


class ProfileError(ValueError):
    """A profile that cannot fly; the message is one line: file, node, parameter, what is
    allowed."""


@dataclass(frozen=True)
class Profile:
    """The parameter sets of a flight, by node, and where they came from."""

    name: str
    file: Path
    sets: dict[str, ParameterSet]
    sections: dict[str, dict[str, Any]]

    def section(self, node: str) -> dict[str, Any]:
        """Return the raw parameters of a node, {} where the profile has none."""
        return self.sections.get(node, {})

    def laws(self) -> dict[str, str]:
        """Return controller → law."""
        return {node: self.sets[node].law for node in CONTROLLERS}


def parameter_set(node: str, values: Mapping[str, Any]) -> tuple[type[ParameterSet], int]:
    """Return the kind of parameters of a node and its axes; a controller's follow from its law.

    values: the node's section, whose `law` counts. Raises ParameterError for an unknown law.
    """
    if node in OTHERS:
        return OTHERS[node], 0
    sets, axes = CONTROLLERS[node]
    law = values.get("law", catalogue.DEFAULT)
    catalogue.entry(law)
    return sets[law], axes


def load_profile(name_or_file: str) -> Profile:
    """Return a profile by name (config/profiles) or from a .yaml file; raises ProfileError."""
    file = Path(name_or_file)
    if file.suffix not in (".yaml", ".yml"):
        try:
            file = configuration.path(f"profiles/{name_or_file}.yaml")
        except configuration.ConfigurationError as error:
            raise ProfileError(str(error)) from None
    return profile_of(read_sections(file), file)


def profile_of(sections: dict[str, dict[str, Any]], file: Path) -> Profile:
    """Return the checked profile of the raw `sections`, which are those of `file` or belong there.

    Raises ProfileError.
    """
    sets = {}
    for node in NODES:
        aside = (*ROS_OWN, *FLIGHT_OWN.get(node, ()))
        values = {k: v for k, v in sections.get(node, {}).items() if k not in aside}
        try:
            kind, axes = parameter_set(node, values)
            sets[node] = kind.from_mapping(values, axes)
        except ParameterError as error:
            raise ProfileError(f"{file}: {node}: {error}") from None
    return Profile(file.stem, file, sets, sections)


def read_sections(file: Path) -> dict[str, dict[str, Any]]:
    """Return the sections of a ROS parameter file, node → parameters; raises ProfileError."""
    try:
        document = yaml.safe_load(file.read_text())
    except OSError as error:
        raise ProfileError(f"{file}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f" line {mark.line + 1} column {mark.column + 1}" if mark else ""
        raise ProfileError(f"{file}{where}: not valid YAML") from None
    if not isinstance(document, dict):
        raise ProfileError(f"{file}: a ROS parameter file expected: <node>: ros__parameters: ...")
    sections = {}
    for node, body in document.items():
        values = body.get("ros__parameters") if isinstance(body, dict) else None
        if not isinstance(values, dict):
            raise ProfileError(f"{file}: '{node}' has no 'ros__parameters' mapping")
        sections[str(node).strip("/")] = values
    return sections
