"""Parameters and remappings of single nodes, and changes of a vehicle's numbers, checked."""

import math
from collections.abc import Collection, Mapping
from copy import deepcopy
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Any

from uam_control.profiles.profile import (
    BRIDGE,
    BRIDGE_LINKS,
    FLIGHT_OWN,
    NODES,
    Profile,
    profile_of,
)
from uam_control.settings.section import Section
from uam_control.vehicle.description import servo_of
from uam_control.vehicle.loading import NOT_OF_THE_PLANT, check_plant_numbers
from uam_lab.records.results.metrics import plain

# nodes whose parameters are in no profile
FLIGHT_CONTROLLER = "flight_controller"
OTHER_NODES = ("mujoco_sim", "scene", "recorder", "cockpit", FLIGHT_CONTROLLER)
EVERY_NODE = ""
EFFECTS = "effects"  # of the plant, beside the numbers of a vehicle
WHERE = "vehicle_changes:"


class SettingsError(ValueError):
    """An invalid option; the text is one line: what is wrong and what is allowed."""


def parameters(
    profile: Profile, given: Mapping[str, Mapping[str, Any]], engine: str, fused: bool = False
) -> tuple[Profile, dict[str, dict[str, Any]]]:
    """Return the profile with the parameters `given`, and those of nodes without a profile.

    fused: the control nodes are one process, which alone has the node FLIGHT_CONTROLLER.

    Raises SettingsError, ProfileError.
    """
    sections, others = dict(profile.sections), {}
    for node, values in given.items():
        _known_node(node, (*NODES, BRIDGE, *OTHER_NODES))
        if not isinstance(values, Mapping):
            raise SettingsError(f"parameters of {node}: name → value expected, not {values!r}")
        if node == FLIGHT_CONTROLLER and not fused:
            raise SettingsError(f"parameters of {node}: only the fused layout has this node")
        own = BRIDGE_LINKS if node == BRIDGE else FLIGHT_OWN.get(node, ())
        if fixed := [name for name in values if name in own]:
            raise SettingsError(f"{node}: {fixed[0]} follows from the other options of the flight")
        if node not in OTHER_NODES:
            sections[node] = sections.get(node, {}) | plain(dict(values))
        elif engine == "direct":
            raise SettingsError(f"the direct engine has no {node}: its parameters need engine ros")
        else:
            others[node] = plain(dict(values))
    if sections == profile.sections:
        return profile, others
    changed = profile_of(sections, Path("parameters"), profile.vehicle)
    return replace(changed, name=profile.name, file=profile.file), others


def unread(profile: Profile) -> tuple[str, ...]:
    """Return a line about the profile's sections that no node of a flight reads; () without."""
    known = (*NODES, BRIDGE, *OTHER_NODES)
    names = ", ".join(sorted(name for name in profile.sections if name not in known))
    text = f"profile {profile.name}: no node of the flight reads {names}; it has: "
    return (text + ", ".join(known),) if names else ()


def remappings(
    given: Mapping[str, str | Mapping[str, str]], engine: str
) -> dict[str, dict[str, str]]:
    """Return node, or EVERY_NODE → old name → new name.

    Raises SettingsError, also for names with which the nodes would not find each other.
    """
    if given and engine == "direct":
        raise SettingsError("the direct engine has no topics: remappings need engine ros")
    found: dict[str, dict[str, str]] = {}
    for key, value in given.items():
        if isinstance(value, Mapping):
            _known_node(key, (*NODES, BRIDGE, *OTHER_NODES))
            found[key] = dict(value)
        else:
            found.setdefault(EVERY_NODE, {})[key] = value
    for old, new in (pair for names in found.values() for pair in names.items()):
        if not all(isinstance(name, str) and name and ":" not in name for name in (old, new)):
            raise SettingsError(
                f"remapping {old!r} → {new!r}: two names of topics or services expected"
            )
    for node, names in found.items():
        _check_topics(node, names)
    return found


def _check_topics(node: str, names: Mapping[str, str]) -> None:
    """Refuse remappings that would cut the control loop. Raises SettingsError."""
    from uam_msgs_py.messages import topics  # needs ROS, as remappings do
    from uam_msgs_py.node.wiring import WIRES

    every = {topic.name.removeprefix("/") for topic in topics.ALL}
    loop = {wire.topic.name for wire in WIRES} | {topics.DIAGNOSTICS.name.removeprefix("/")}
    bare = {old.removeprefix("/"): new.removeprefix("/") for old, new in names.items()}
    taken: dict[str, str] = {}
    for old, new in bare.items():
        if node != EVERY_NODE and old in loop:
            raise SettingsError(
                f"remapping {old} of {node} alone would cut the control loop: "
                "give it for every node, as topic → new name"
            )
        other = new if new in every - bare.keys() and new != old else taken.get(new)
        if other is not None and (old in every or other in every):
            raise SettingsError(f"remapping {old} → {new}: that is the topic {other}")
        taken[new] = old


def _known_node(node: str, nodes: Collection[str]) -> None:
    if node not in nodes:
        raise SettingsError(f"unknown node '{node}'; there are: {', '.join(nodes)}")


def checked_changes(given: Mapping[str, Any], numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the changes of a vehicle's numbers, dotted name → value, in lists and plain numbers.

    numbers: those of its description, which the changes must fit: names, types, lengths of lists,
    and what the plant requires of them. Raises SettingsError.
    """
    changed, found = deepcopy(dict(numbers)), {}
    for name, value in given.items():
        found[name] = value if name == EFFECTS else plain(value)
        if name != EFFECTS:
            entry, last = _place(name, changed)
            _check_read(str(name), changed)
            _check_alike(name, value, entry[last])
            entry[last] = found[name]
    if found.keys() - {EFFECTS}:
        where = f"{WHERE} servos"
        joints = range(len(changed["joints"]))
        servos = [Section(servo_of(changed, i), where, SettingsError) for i in joints]
        check_plant_numbers(Section(changed, WHERE, SettingsError), servos)
    return found


def _place(name: Any, numbers: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Return the mapping that has the entry `name`, and its key there. Raises SettingsError."""
    entry: Any = numbers
    keys = str(name).split(".")
    for depth, key in enumerate(keys):
        if not isinstance(entry, dict) or key not in entry:
            above = ".".join(keys[:depth]) or "the vehicle"
            allowed = ", ".join(entry) if isinstance(entry, dict) else "nothing, it is a value"
            raise SettingsError(f"{WHERE} unknown entry '{name}'; {above} has: {allowed}")
        if depth < len(keys) - 1:
            entry = entry[key]
    return entry, keys[-1]


def _check_read(name: str, numbers: dict[str, Any]) -> None:
    """Raise SettingsError for an entry that the plant does not read."""
    if any(f"{name}.".startswith(f"{entry}.") for entry in NOT_OF_THE_PLANT):
        top, dot, _ = name.partition(".")
        beside = [f"{top}.{key}" for key in numbers[top]] if dot else list(numbers)
        read = ", ".join(one for one in beside if one not in NOT_OF_THE_PLANT)
        raise SettingsError(
            f"{WHERE} {name}: the plant does not read it, give a vehicle file; it reads {read}"
        )


def _check_alike(name: str, value: Any, before: Any) -> None:
    """Raise SettingsError if a value is of another type or length than the one it replaces."""
    expected = ""
    if _is_number(before):
        expected = "" if _is_number(value) else "a number"
    elif isinstance(before, str):
        expected = "" if isinstance(value, str) else "a text"
    elif before and isinstance(before, list) and all(map(_is_number, before)):
        values = plain(value)
        fits = isinstance(values, list) and len(values) == len(before)
        expected = (
            "" if fits and all(map(_is_number, values)) else f"a list of {len(before)} numbers"
        )
    elif isinstance(before, dict):
        expected = f"one of its entries, {', '.join(before)},"
    if expected:
        raise SettingsError(f"{WHERE} {name}: {expected} expected, got {value!r}")


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)
