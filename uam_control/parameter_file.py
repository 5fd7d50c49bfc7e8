"""ROS parameter files, as written by hand, by `ros2 param dump`, and by a flight.

    /position_controller:
      ros__parameters:
        inertia: [2.2, 2.2, 2.2]
        ...

What ROS gives every node (and a dump therefore has) is left out; files of several nodes may simply
be joined into one.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

# what rclpy declares in every node by itself
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


class ProfileError(ValueError):
    """A profile that cannot fly; the message is one line: file, node, parameter, what is
    allowed."""


class _Loader(yaml.SafeLoader):
    """Reads 1e-4 as the number that it is to ROS; YAML 1.1 wants 1.0e-4."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?[0-9][0-9_]*(\.[0-9_]*)?[eE][-+]?[0-9]+$"),
    list("-+0123456789"),
)


def read_sections(file: Path) -> dict[str, dict[str, Any]]:
    """Return the sections of a ROS parameter file, node → parameters; raises ProfileError."""
    try:
        document = yaml.load(file.read_text(), _Loader)  # noqa: S506 (a SafeLoader)
    except OSError as error:
        raise ProfileError(f"{file}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f" line {mark.line + 1} column {mark.column + 1}" if mark else ""
        raise ProfileError(f"{file}{where}: not valid YAML") from None
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
