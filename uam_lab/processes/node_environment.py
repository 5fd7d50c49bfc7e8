"""The variables by which the processes of a flight find each other, and nobody else does."""

from __future__ import annotations

import os
from pathlib import Path

from uam_control.settings import configuration
from uam_lab.processes import thread_stop
from uam_lab.processes.child import SINGLE_THREAD

PROFILES_FILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
FAST_DDS = "fastrtps"  # in the names of its middlewares


def environment(domain: int, log_folder: Path) -> dict[str, str]:
    """What the children inherit: a private, local ROS domain and one thread each."""
    return {**os.environ, **ros_environment(domain, log_folder), **SINGLE_THREAD}


def ros_environment(domain: int, log_folder: Path) -> dict[str, str]:
    """The variables by which ROS finds its domain, its transports and the place of its logs."""
    return {
        **transport_environment(),
        "ROS_DOMAIN_ID": str(domain),
        "ROS_LOG_DIR": str(log_folder),
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }


def transport_environment() -> dict[str, str]:
    """The variables that keep ROS on this machine.

    Our transports do so by themselves (config/dds/fastdds.xml). Where the user's own file or
    another middleware is used, ROS is told to.
    """
    transports = str(configuration.path("dds/fastdds.xml"))
    chosen = os.environ.get(PROFILES_FILE) or transports
    ours = chosen == transports and FAST_DDS in middleware()
    return {
        PROFILES_FILE: chosen,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT" if ours else "LOCALHOST",
    }


def middleware() -> str:
    """The middleware that ROS is going to use."""
    return os.environ.get("RMW_IMPLEMENTATION") or f"rmw_{FAST_DDS}_cpp"


def without_discovery() -> str:
    """Why a process's threads of discovery cannot be stopped here; empty where they can be."""
    if FAST_DDS not in middleware():
        return f"it knows the threads of Fast DDS, not those of {middleware()}"
    return thread_stop.refusal()
