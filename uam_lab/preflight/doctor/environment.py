"""Checks of environment variables that change the discovery of nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from uam_lab.flights.processes.node_environment import PROFILES_FILE
from uam_lab.preflight.doctor.finding import Finding, fail, ok, warn
from uam_sim_bridge.ports import LAST_DOMAIN

NAME = "environment"
BY_HAND = "uam fly sets its own domain; nodes started by hand"


class Variable(NamedTuple):
    """What a variable's value means. fine: whether it is no problem; good, bad: text after it."""

    bad: str
    advice: str  # {}: name of the variable
    fine: Callable[[str], bool] = lambda value: False
    good: str = ""


def _is_domain(value: str) -> bool:
    return value.isascii() and value.isdecimal() and int(value) <= LAST_DOMAIN


VARIABLES = {
    "ROS_DOMAIN_ID": Variable(
        f" is not in 0..{LAST_DOMAIN}",
        f"{BY_HAND} fail with it: unset {{}}",
        _is_domain,
        f": {BY_HAND} use it",
    ),
    "RMW_IMPLEMENTATION": Variable(
        ": the stack is tested with rmw_fastrtps_cpp, and config/dds is for that one",
        "unset {}",
        lambda value: value == "rmw_fastrtps_cpp",
    ),
    PROFILES_FILE: Variable(
        " replaces config/dds/fastdds.xml: smaller buffers lose messages",
        "unset {}, unless it is intended",
    ),
    "ROS_LOCALHOST_ONLY": Variable(
        " is deprecated and overrides ROS_AUTOMATIC_DISCOVERY_RANGE: no other computer is found",
        "no effect on uam fly; for a vehicle: unset {}",
        lambda value: value == "0",
    ),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": Variable(
        f": {BY_HAND} find no other node",
        "unset {}",
        lambda value: value in ("SUBNET", "LOCALHOST", "SYSTEM_DEFAULT"),
        f": {BY_HAND} use it",
    ),
    "ROS_DISCOVERY_SERVER": Variable(
        ": nodes started by hand use only that server for discovery; uam fly does not use it",
        "unset {}, or start the server",
    ),
    "ROS_SECURITY_ENABLE": Variable(
        ": every node needs a key store and an enclave, those of uam fly too",
        "docs/interfaces.md, or unset {}",
        lambda value: value != "true",  # as rcl reads it
        ": security is off",
    ),
    "ROS_SECURITY_STRATEGY": Variable(
        ": with ROS_SECURITY_ENABLE=true no node starts without an enclave",
        "docs/interfaces.md, or unset {}",
        lambda value: value != "Enforce",
    ),
    "ROS_SECURITY_KEYSTORE": Variable(
        " has no folder enclaves: with ROS_SECURITY_ENABLE=true nodes find no keys",
        "ros2 security create_keystore, see docs/interfaces.md, or unset {}",
        lambda value: (Path(value) / "enclaves").is_dir(),
    ),
    "FASTDDS_BUILTIN_TRANSPORTS": Variable(
        " changes the transport of messages", "unset {}, unless it is intended"
    ),
}


def checks(surroundings: Mapping[str, str]) -> Iterator[Finding]:
    """Yield one finding per set variable, or one for all if none is set."""
    present = [name for name in VARIABLES if surroundings.get(name)]
    if not present:
        yield ok(NAME, f"none set of {', '.join(VARIABLES)}")
    for name in present:
        value, variable = surroundings[name], VARIABLES[name]
        text, advice = f"{name}={value}", variable.advice.format(name)
        if name == PROFILES_FILE and not Path(value).is_file():
            yield fail(NAME, f"{text} is no file", f"unset {name}")
        elif variable.fine(value):
            yield ok(NAME, text + variable.good)
        else:
            yield warn(NAME, text + variable.bad, advice)
