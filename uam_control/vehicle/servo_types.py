"""The servos of a vehicle's file: one type for all joints, or types by name, chosen by joints."""

from __future__ import annotations

from typing import Any

from uam_control.settings.section import Section

# of the bus and its driver, which are one
COMMON = "mode", "command_latency_ticks", "position_p_gain", "pwm_limit"


def servo_types(top: Section) -> list[Section]:
    """Return the entries of the servo of each joint.

    `servos` is one type, or a mapping of types by name; then each joint has the name of its
    `servo`. Raises the section's error for a joint without one, and for types that differ in what
    is common to a bus.
    """
    servos, joints = top.section("servos"), top.entries("joints")
    if not all(isinstance(value, dict) for value in servos.values.values()):
        if chosen := [joint for joint in joints if joint.has("servo")]:
            raise chosen[0].error("servo", "servos has no types by name, but one type for all")
        return [servos] * len(joints)
    types = {name: servos.section(name) for name in servos.values}
    chosen = [joint.one_of("servo", types) for joint in joints]
    if unused := [name for name in types if name not in chosen]:
        raise servos.error(unused[0], "no joint has this servo")
    for key in COMMON:
        if any(one.entry(key) != types[chosen[0]].entry(key) for one in types.values()):
            values = ", ".join(f"{name} {one.values[key]}" for name, one in types.items())
            raise servos.error(key, f"{values}: the servos of one bus have the same")
    return [types[name] for name in chosen]


def merged(servos: list[Section]) -> dict[str, Any]:
    """Return the entries of all joints as one mapping; a list where joints differ."""
    entries = {}
    for key in servos[0].values:
        if lacking := [one for one in servos if key not in one.values]:
            raise lacking[0].error(key, "missing; another type has it")
        values = [one.values[key] for one in servos]  # not asked for: an unknown one is refused
        entries[key] = values[0] if all(one == values[0] for one in values) else values
    return entries


def apart(
    numbers: dict[str, Any], joints: int, where: str, error: type[ValueError]
) -> list[Section]:
    """Return the entries of each joint of what `merged` returns; where, error: see `Section`."""
    return [
        Section({k: v[i] if isinstance(v, list) else v for k, v in numbers.items()}, where, error)
        for i in range(joints)
    ]
