"""ROS parameter files, written by hand, by `ros2 param dump` or by a flight.

    /position_controller:
      ros__parameters:
        inertia: [2.2, 2.2, 2.2]
        ...

The reader leaves out the parameters that ROS declares in every node; a dump contains them. Files
of several nodes can be concatenated.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from uam_control.settings import yaml_file

# parameters that rclpy declares in every node
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


class ProfileError(ValueError):
    """A profile that is not valid; one-line message: file, node, parameter, allowed range."""


def read_sections(file: Path) -> dict[str, dict[str, Any]]:
    """Return the sections of a ROS parameter file: node → parameters. Raises ProfileError."""
    document = yaml_file.read(file, ProfileError)
    if not isinstance(document, dict):
        raise ProfileError(f"{file}: a ROS parameter file expected: <node>: ros__parameters: ...")
    sections: dict[str, dict[str, Any]] = {}
    for full_name, body in document.items():
        values = body.get("ros__parameters") if isinstance(body, dict) else None
        if not isinstance(values, dict):
            raise ProfileError(f"{file}: '{full_name}' has no 'ros__parameters' mapping")
        node = str(full_name).rpartition("/")[2]
        if "*" in node:
            raise ProfileError(f"{file}: '{full_name}': name each node instead")
        if node in sections:
            raise ProfileError(f"{file}: two sections of a node {node}")
        sections[node] = {name: value for name, value in values.items() if name not in ROS_OWN}
    return sections
