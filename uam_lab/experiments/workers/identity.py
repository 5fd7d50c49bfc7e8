"""What is the same in all processes that fly one campaign: versions, sources, configuration."""

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

from uam_control.settings import configuration

DISTRIBUTIONS = ("mujoco", "numba", "numpy", "scipy")  # those that compute a flight
PACKAGES = ("uam_control", "uam_msgs_py", "uam_sim_bridge", "uam_lab")
SOURCES = "sources and configuration of uam"


@cache
def identity() -> dict[str, str]:
    """Return the versions, and a digest of the sources and the configuration, of this process."""
    return {
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in DISTRIBUTIONS},
        SOURCES: _digest(),
    }


def difference(expected: Mapping[str, str], found: Mapping[str, str]) -> str:
    """Return in words what differs first; "" if nothing does."""
    for name, value in expected.items():
        if found.get(name) != value:
            return f"{name} {found.get(name)}, here {value}"
    return ""


def _digest() -> str:
    top = Path(__file__).resolve().parents[3]
    files = [
        (file.relative_to(top).as_posix(), file)
        for package in PACKAGES
        for file in (top / package).rglob("*.py")
    ]
    root = configuration.root()
    files += [
        (f"config/{file.relative_to(root).as_posix()}", file)
        for file in root.rglob("*")
        if file.is_file() and not file.name.startswith(".")
    ]
    total = hashlib.sha256()
    for name, file in sorted(files):
        total.update(f"{name}\0{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()[:12]
