"""Python, packages, configuration, compiled control path."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterable, Iterator
from importlib import metadata

from packaging.requirements import InvalidRequirement, Requirement

from uam_control.maths import compiled
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_lab.doctor.finding import Finding, fail, ok, warn

NAME = "uam"
PYTHON = (3, 11)
AGAIN = "make setup, or pip install again"


def checks() -> Iterator[Finding]:
    """Findings about the installation."""
    yield python(sys.version_info[:3])
    yield packages(_requirements())
    yield config()
    yield control_path()


def python(version: tuple[int, ...]) -> Finding:
    """Whether the interpreter, of `version`, is new enough."""
    found = f"{platform.python_implementation()} {'.'.join(map(str, version))} at {sys.executable}"
    if version[:2] < PYTHON:
        wanted = ".".join(map(str, PYTHON))
        return fail("python", found, f"Python {wanted} or newer is needed: make PYTHON=... setup")
    return ok("python", found)


def packages(requirements: Iterable[str] | None) -> Finding:
    """Whether every package is there in a version that is wanted; None: nobody knows which."""
    if requirements is None:
        return warn("packages", f"{NAME} is not installed: no list of what it needs", AGAIN)
    missing, wrong, count = [], [], 0
    for line in requirements:
        try:
            wanted = Requirement(line)
        except InvalidRequirement:
            continue
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        count += 1
        try:
            version = metadata.version(wanted.name)
        except metadata.PackageNotFoundError:
            missing.append(f"{wanted.name}{wanted.specifier}")
            continue
        if not wanted.specifier.contains(version, prereleases=True):
            wrong.append(f"{wanted.name} {version}, wanted {wanted.specifier}")
    if missing or wrong:
        found = "; ".join([f"missing: {', '.join(missing)}"] * bool(missing) + wrong)
        lines = [*missing, *(re.sub(r" .*wanted ", "", text) for text in wrong)]
        quoted = " ".join(f'"{line}"' for line in lines)
        return fail("packages", found, f"{sys.executable} -m pip install {quoted}")
    return ok("packages", f"{NAME} {metadata.version(NAME)} and the {count} packages it needs")


def _requirements() -> list[str] | None:
    try:
        return metadata.requires(NAME)
    except metadata.PackageNotFoundError:
        return None


def config() -> Finding:
    """Whether the files of config/ are found, and the default profile and scenario can be read."""
    from uam_control.mission import ScenarioError, load_scenario
    from uam_control.profiles.profile import ProfileError, load_profile

    try:
        load_profile("s500")
        load_scenario("pick_and_place")
        return ok("config", str(configuration.root()))
    except (ConfigurationError, ProfileError, ScenarioError, OSError) as error:
        return fail("config", str(error), AGAIN)


def control_path() -> Finding:
    """Whether the control path is compiled already."""
    from uam_lab.flight.direct.warm_up import compiled_functions, is_cold

    if compiled.numba is None:
        return warn(
            "compiled",
            "numba is missing: the control path runs as plain Python",
            "flights work, slower: pip install numba",
        )
    count = sum(1 for _ in compiled_functions())
    if count == 0:
        return warn("compiled", "compilation is switched off", "unset NUMBA_DISABLE_JIT")
    if is_cold():
        return warn(
            "compiled",
            "the control path is not compiled yet",
            "nothing to do: the next flight compiles it once, in a minute or so",
        )
    return ok("compiled", f"{count} functions of the control path are compiled")
