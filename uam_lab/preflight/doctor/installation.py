"""Checks of the installation: Python, packages, configuration, compiled control path."""

import platform
import re
import sys
from collections.abc import Iterable, Iterator
from importlib import metadata

from packaging.requirements import InvalidRequirement, Requirement

from uam_control.maths import compiled
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_lab.preflight.doctor.finding import Finding, fail, ok, warn

NAME = "uam"
PYTHON = (3, 11)
AGAIN = "make setup, or pip install again"


def checks() -> Iterator[Finding]:
    yield python(sys.version_info[:3])
    yield packages(_requirements())
    yield config()
    yield control_path()


def python(version: tuple[int, ...]) -> Finding:
    """Check that the interpreter, of `version`, is new enough."""
    found = f"{platform.python_implementation()} {'.'.join(map(str, version))} at {sys.executable}"
    if version[:2] < PYTHON:
        least = ".".join(map(str, PYTHON))
        return fail("python", found, f"Python {least} or newer is needed: make PYTHON=... setup")
    return ok("python", found)


def packages(requirements: Iterable[str] | None) -> Finding:
    """Check the version of every required package; requirements: None if unknown."""
    if requirements is None:
        return warn("packages", f"{NAME} is not installed: its requirements are unknown", AGAIN)
    missing, wrong, count = [], [], 0
    for line in requirements:
        try:
            required = Requirement(line)
        except InvalidRequirement:
            continue
        if required.marker is not None and not required.marker.evaluate({"extra": ""}):
            continue
        count += 1
        try:
            version = metadata.version(required.name)
        except metadata.PackageNotFoundError:
            missing.append(f"{required.name}{required.specifier}")
            continue
        if not required.specifier.contains(version, prereleases=True):
            wrong.append(f"{required.name} {version}, required {required.specifier}")
    if missing or wrong:
        found = "; ".join([f"missing: {', '.join(missing)}"] * bool(missing) + wrong)
        lines = [*missing, *(re.sub(r" .*required ", "", text) for text in wrong)]
        quoted = " ".join(f'"{line}"' for line in lines)
        return fail("packages", found, f"{sys.executable} -m pip install {quoted}")
    return ok("packages", f"{NAME} {metadata.version(NAME)} and {count} required packages")


def _requirements() -> list[str] | None:
    try:
        return metadata.requires(NAME)
    except metadata.PackageNotFoundError:
        return None


def config() -> Finding:
    """Check that config/ is found and that the default profile and scenario can be read."""
    from uam_control.mission import ScenarioError, load_scenario
    from uam_control.profiles.profile import ProfileError, load_profile

    try:
        load_profile("s500")
        load_scenario("pick_and_place")
        return ok("config", str(configuration.root()))
    except (ConfigurationError, ProfileError, ScenarioError, OSError) as error:
        return fail("config", str(error), AGAIN)


def control_path() -> Finding:
    """Check that the control path is compiled."""
    from uam_lab.flights.direct.warm_up import compiled_functions, is_cold

    if compiled.numba is None:
        return warn(
            "compiled",
            "numba is missing: the control path runs as plain Python",
            "flights work, but slowly: pip install numba",
        )
    count = sum(1 for _ in compiled_functions())
    if count == 0:
        return warn("compiled", "compilation is switched off", "unset NUMBA_DISABLE_JIT")
    if is_cold():
        return warn(
            "compiled",
            "the control path is not compiled yet",
            "no action needed: the next flight compiles it once, in about a minute",
        )
    return ok("compiled", f"{count} functions of the control path are compiled")
