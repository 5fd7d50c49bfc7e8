"""The middleware of ROS: which one it will use, and whether that one is installed.

rcl ends the process if it is not, with its own words; this is known before.
"""

import os
import sys
from pathlib import Path

VARIABLE = "RMW_IMPLEMENTATION"
DEFAULT = "rmw_fastrtps_cpp"
INDEX = "share/ament_index/resource_index/rmw_typesupport"  # one file per middleware, of that name


def middleware() -> str:
    """Return the middleware that ROS will use."""
    return os.environ.get(VARIABLE) or DEFAULT


def refusal() -> str:
    """Return, in one line, why ROS cannot use that middleware; "" if it can or nobody knows."""
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    indexes = [Path(prefix) / INDEX for prefix in (*prefixes, sys.prefix)]
    installed = sorted({
        file.name
        for index in indexes if index.is_dir()
        for file in index.iterdir() if file.name != "rmw_implementation"
    })  # fmt: skip
    if not installed or middleware() in installed:
        return ""
    return (
        f"{VARIABLE}={middleware()} is not installed: unset it; there are: {', '.join(installed)}"
    )
