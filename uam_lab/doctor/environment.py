"""Checks of environment variables that change the discovery of nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from uam_lab.doctor.finding import Finding, fail, ok, warn
from uam_lab.processes.node_environment import PROFILES_FILE
from uam_sim_bridge.ports import LAST_DOMAIN

BY_HAND = "uam fly sets its own domain; nodes started by hand"


def checks(surroundings: Mapping[str, str]) -> Iterator[Finding]:
    """Yield one finding per set variable, or one for all if none is set."""
    found = [
        check(name, surroundings[name])
        for name, check in VARIABLES.items()
        if surroundings.get(name)
    ]
    yield from found or [ok("environment", f"none set of {', '.join(VARIABLES)}")]


def _domain(name: str, value: str) -> Finding:
    text = f"{name}={value}"
    if not (value.isascii() and value.isdecimal() and int(value) <= LAST_DOMAIN):
        return warn(
            "environment",
            f"{text} is not in 0..{LAST_DOMAIN}",
            f"{BY_HAND} fail with it: unset {name}",
        )
    return ok("environment", f"{text}: {BY_HAND} use it")


def _middleware(name: str, value: str) -> Finding:
    if value == "rmw_fastrtps_cpp":
        return ok("environment", f"{name}={value}")
    return warn(
        "environment",
        f"{name}={value}: the stack is tested with rmw_fastrtps_cpp, and "
        "config/dds is for that one",
        f"unset {name}",
    )


def _profiles(name: str, value: str) -> Finding:
    if not Path(value).is_file():
        return fail("environment", f"{name}={value} is no file", f"unset {name}")
    return warn(
        "environment",
        f"{name}={value} replaces config/dds/fastdds.xml: smaller buffers lose messages",
        f"unset {name}, unless it is intended",
    )


def _local_only(name: str, value: str) -> Finding:
    if value == "0":
        return ok("environment", f"{name}={value}")
    return warn(
        "environment",
        f"{name}={value} is deprecated and overrides "
        "ROS_AUTOMATIC_DISCOVERY_RANGE: no other computer is found",
        f"no effect on uam fly; for a vehicle: unset {name}",
    )


def _range(name: str, value: str) -> Finding:
    if value in ("SUBNET", "LOCALHOST", "SYSTEM_DEFAULT"):
        return ok("environment", f"{name}={value}: {BY_HAND} use it")
    return warn("environment", f"{name}={value}: {BY_HAND} find no other node", f"unset {name}")


def _server(name: str, value: str) -> Finding:
    return warn(
        "environment",
        f"{name}={value}: nodes use only that server for discovery",
        f"unset {name}, or start the server",
    )


def _transports(name: str, value: str) -> Finding:
    return warn(
        "environment",
        f"{name}={value} changes the transport of messages",
        f"unset {name}, unless it is intended",
    )


# name → check of its value, for the variables that are set
VARIABLES: dict[str, Callable[[str, str], Finding]] = {
    "ROS_DOMAIN_ID": _domain,
    "RMW_IMPLEMENTATION": _middleware,
    PROFILES_FILE: _profiles,
    "ROS_LOCALHOST_ONLY": _local_only,
    "ROS_AUTOMATIC_DISCOVERY_RANGE": _range,
    "ROS_DISCOVERY_SERVER": _server,
    "FASTDDS_BUILTIN_TRANSPORTS": _transports,
}
