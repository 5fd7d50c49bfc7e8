"""Names of a vehicle's nodes in a ROS graph with several vehicles.

A namespace moves topics, services and parameters by itself. This module does it where ROS does not:

| what | without a namespace | in /uav1 |
|---|---|---|
| status name on /diagnostics | `mission` | `uav1/mission` |
| frame on /tf and in headers | `base_link` | `uav1/base_link` |
| section of a parameter file | `mission:` | `mission:` too, if the file has no `/uav1/mission:` |
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uam_control.settings import yaml_file
from uam_control.settings.parameter_set import ParameterError

if TYPE_CHECKING:
    from rclpy.node import Node

NAME = re.compile(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
ALLOWED = "letters, digits and _, not a digit first; / between several names"


def normal(namespace: str) -> str:
    """Return a namespace in the form of ROS: `uav1` → `/uav1`, "" → `/`.

    Raises ValueError, in one line, for an invalid one.
    """
    inner = namespace.removeprefix("/")
    if inner and not NAME.fullmatch(inner):
        raise ValueError(f"namespace '{namespace}': allowed are {ALLOWED}")
    return f"/{inner}"


def prefix(namespace: str) -> str:
    """Return the prefix of frames and status names: `/uav1` → `uav1/`, `/` → ""."""
    inner = namespace.strip("/")
    return f"{inner}/" if inner else ""


def label(node: Node) -> str:
    """Return the name of a node's status on /diagnostics."""
    return prefix(node.get_namespace()) + node.get_name()


def frame(node: Node, name: str) -> str:
    """Return the name of one of the vehicle's frames."""
    return prefix(node.get_namespace()) + name


def expanded(namespace: str, name: str) -> str:
    """Return the absolute name of a topic, without remappings; an absolute one is unchanged."""
    return name if name.startswith("/") else f"/{prefix(namespace)}{name}"


def unlabelled(namespace: str, name: str) -> str | None:
    """Return the node of a status name on /diagnostics; None for a node of another namespace."""
    own = prefix(namespace)
    inner = name.removeprefix(own)
    return inner if name.startswith(own) and "/" not in inner else None


def adopt_sections(node: Node) -> None:
    """Give a node in a namespace also the sections of its bare name in its parameter files.

    ROS applies `mission:` only to `/mission`; the files of config/ name the nodes so. Values from
    the command line and from sections with the full name go first. Raises ParameterError.
    """
    if node.get_namespace() == "/":
        return
    from rclpy.parameter import Parameter

    found = _in_files(f"/{node.get_name()}")
    overrides = node._parameter_overrides
    for name, value in found.items():
        if name not in overrides:
            overrides[name] = Parameter(name, value=value)


def neighbour_section(node: Node, name: str) -> dict[str, Any]:
    """Return what the command line of `node` says for node `name` of the same vehicle.

    ROS gives a node only its own section. Raises ParameterError.
    """
    found = shared_section() | _in_files(f"/{name}")
    if node.get_namespace() == "/":  # ROS applies `-p node:x:=1` only there
        return found | _on_command_line(name)
    return found | _in_files(expanded(node.get_namespace(), name))


def shared_section() -> dict[str, Any]:
    """Return what the parameter files say for every node, in `/**`. Raises ParameterError."""
    return _in_files("/**")


def _in_files(section: str) -> dict[str, Any]:
    """Return the parameters of a section, by its absolute name, in the files of the command line.

    `/uav1/mission:` may also be `uav1: mission:`.
    """
    found: dict[str, Any] = {}
    for file in _arguments("--params-file"):
        for name, body in _sections(yaml_file.read(Path(file), ParameterError)):
            if name == section:
                found |= body
    return found


def _sections(document: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the absolute name and the parameters of each section."""
    if isinstance(document, dict):
        for key, body in document.items():
            if key == "ros__parameters":
                yield path, body or {}
            else:
                yield from _sections(body, f"{path}/{str(key).strip('/')}")


def _on_command_line(node: str) -> dict[str, Any]:
    """Return the parameters given as `-p node:name:=value`."""
    given = (text.partition(":=") for text in _arguments("-p", "--param"))
    return {
        name.removeprefix(f"{node}:"): yaml_file.parsed(value)
        for name, _, value in given
        if name.startswith(f"{node}:")
    }


def _arguments(*flags: str) -> list[str]:
    """Return what follows the flags in the command line."""
    return [value for flag, value in pairwise(sys.argv) if flag in flags]
