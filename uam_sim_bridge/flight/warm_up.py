"""Compiles the control path before a flight, so that no node compiles in it.

The compiled functions are kept on disk beside their sources (see uam_control.compiled); with all of
them there and up to date nothing is left to do.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from uam_control.laws.catalogue import LAWS
from uam_control.mission import load_scenario
from uam_control.profile import load_profile
from uam_sim_bridge.flight.direct import DirectFlight
from uam_sim_bridge.plant import Vehicle

PACKAGES = ("uam_control", "uam_sim_bridge")
TICKS = 1000  # 4 s: the vehicle is armed and in the air by then, and every function has run


def compiled_functions() -> Iterator:
    """Every function under `jit` in the modules imported so far; none without numba."""
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] in PACKAGES:
            for value in vars(module).values():
                if hasattr(value, "py_func") and value.py_func.__module__ == name:
                    yield value


def is_cold() -> bool:
    """Whether a function of the control path has no compiled form newer than its source."""
    for function in compiled_functions():
        source = Path(function.py_func.__code__.co_filename)
        pattern = f"{source.stem}.{function.py_func.__qualname__}-*.nbi"
        cached = Path(function.stats.cache_path).glob(pattern)
        if not any(file.stat().st_mtime >= source.stat().st_mtime for file in cached):
            return True
    return False


def warm_up() -> None:
    """Fly a few seconds in the direct engine with each law: it runs every function of the nodes."""
    scenario, vehicle = load_scenario("hover"), Vehicle.load()
    for entry in LAWS.values():
        flight = DirectFlight(scenario, load_profile(entry.profile), vehicle, 0.0, seed=1)
        for _ in range(TICKS):
            flight.tick()
