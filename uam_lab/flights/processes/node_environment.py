"""Environment variables of a flight's processes: a private ROS domain on this machine."""

import os
import shlex
import sys
from pathlib import Path

from uam_control.settings import configuration
from uam_lab.flights.processes import thread_stop
from uam_lab.flights.processes.child import SINGLE_THREAD, copied
from uam_lab.flights.processes.middleware import middleware

PROFILES_FILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
FAST_DDS = "fastrtps"  # in the names of its middlewares


def environment(domain: int, log_folder: Path) -> dict[str, str]:
    """Return the environment of the children: a private, local ROS domain and one thread each."""
    return {**copied(), **ros_environment(domain, log_folder), **SINGLE_THREAD}


def ros_environment(domain: int, log_folder: Path) -> dict[str, str]:
    """Return the variables for ROS domain, transports and log folder."""
    return {
        **transport_environment(),
        "ROS_DOMAIN_ID": str(domain),
        "ROS_LOG_DIR": str(log_folder),
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }


def export_line(domain: int) -> str:
    """Return a line for the user's shell: with it `ros2` finds the nodes of a flight.

    It works in any shell of POSIX form; the values are quoted.
    """
    prefixes = [one for one in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if one]
    if sys.prefix not in prefixes and (Path(sys.prefix) / "share" / "ament_index").is_dir():
        prefixes.append(sys.prefix)
    values = {
        "ROS_DOMAIN_ID": str(domain),
        "RMW_IMPLEMENTATION": middleware(),
        **transport_environment(),
        "AMENT_PREFIX_PATH": os.pathsep.join(prefixes),
    }
    return "export " + " ".join(f"{name}={shlex.quote(value)}" for name, value in values.items())


def transport_environment() -> dict[str, str]:
    """Return the variables that restrict ROS to this machine.

    The transports of config/dds/fastdds.xml do so themselves. With the user's own file or another
    middleware the discovery range is set to LOCALHOST. A discovery server of the user's shell is
    left out: the nodes would wait for it and find each other nowhere else.
    """
    transports = str(configuration.path("dds/fastdds.xml"))
    chosen = os.environ.get(PROFILES_FILE) or transports
    ours = chosen == transports and FAST_DDS in middleware()
    return {
        PROFILES_FILE: chosen,
        "ROS_DISCOVERY_SERVER": "",  # as if it were not set
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT" if ours else "LOCALHOST",
    }


def without_discovery() -> str:
    """Return why discovery threads cannot be stopped on this machine, "" if they can."""
    if FAST_DDS not in middleware():
        return f"it supports Fast DDS only, not {middleware()}"
    return thread_stop.refusal()
