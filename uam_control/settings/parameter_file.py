"""ROS parameter files, written by hand, by `ros2 param dump` or by a flight.

    /position_controller:
      ros__parameters:
        inertia: [2.2, 2.2, 2.2]
        ...

The reader leaves out the parameters that ROS declares in every node; a dump contains them. Files
of several nodes can be concatenated.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from uam_control.settings import yaml_file

# parameters that rclpy declares in every node
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
EVERY_NODE = "**"  # section of the nodes that have the parameter


class ProfileError(ValueError):
    """A profile that is not valid; one-line message: file, node, parameter, allowed range."""


def read_sections(file: Path, namespace: str = "/") -> dict[str, dict[str, Any]]:
    """Return the sections of a ROS parameter file for a vehicle: node → parameters.

    namespace: of the vehicle's nodes, in the form of ROS. In `/uav1` the section of a node is
    `mission:` or `/uav1/mission:`; values in the full name's go first. EVERY_NODE has the values of
    the section `/**`. Raises ProfileError, also for a section of another namespace.
    """
    document = yaml_file.read(file, ProfileError)
    if not isinstance(document, dict):
        raise ProfileError(f"{file}: a ROS parameter file expected: <node>: ros__parameters: ...")
    own = namespace.rstrip("/")
    bare: dict[str, dict[str, Any]] = {}
    full: dict[str, dict[str, Any]] = {}
    for name, values in _sections(file, document):
        place, _, node = name.rpartition("/")
        if "*" in name and name != f"/{EVERY_NODE}":
            raise ProfileError(f"{file}: '{name}': name each node instead, or all of them by /**:")
        if place not in ("", own):
            raise ProfileError(
                f"{file}: '{name}' is of namespace {place}, not {namespace}: name the section "
                f"'{node}:' to use it here"
            )
        sections = full if place else bare
        if node in sections:
            raise ProfileError(f"{file}: two sections of a node {node}")
        sections[node] = {name: value for name, value in values.items() if name not in ROS_OWN}
    return {node: bare.get(node, {}) | full.get(node, {}) for node in (bare | full)}


def _sections(
    file: Path, document: dict[Any, Any], path: str = ""
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield absolute name and parameters of each section; `/uav1/mission:` may be nested."""
    for key, body in document.items():
        name = f"{path}/{str(key).strip('/')}"
        values = body.get("ros__parameters") if isinstance(body, dict) else None
        if isinstance(values, dict):
            if beside := [str(one) for one in body if one != "ros__parameters"]:
                raise ProfileError(f"{file}: '{key}': {beside[0]}: not within 'ros__parameters'")
            yield name, values
        elif values is None and body and all(isinstance(one, dict) for one in _inner(body)):
            yield from _sections(file, body, name)
        else:
            shown = name.removeprefix("/") if path else key
            raise ProfileError(f"{file}: '{shown}' has no 'ros__parameters' mapping")


def _inner(body: Any) -> Any:
    return body.values() if isinstance(body, dict) else [None]


def as_text(sections: Mapping[str, Mapping[str, Any]]) -> str:
    """Return sections, node → parameter → value, as a ROS parameter file; lists in one line."""
    nodes = {node: {"ros__parameters": values} for node, values in sections.items()}
    return yaml.safe_dump(nodes, sort_keys=False, default_flow_style=None, width=100)
