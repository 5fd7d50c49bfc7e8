"""Finds a PX4 SITL build in the directory that the user gives. This project contains no PX4."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

# of a build, and of one without lockstep, for px4_hitl and uam rehearse
VARIABLE, LOOP_VARIABLE = "PX4_SITL_DIR", "PX4_HITL_DIR"
_IN_SOURCES = {VARIABLE: "build/px4_sitl_default", LOOP_VARIABLE: "build/px4_sitl_nolockstep"}
_STARTUP = "etc/init.d-posix/rcS"
_LISTED = "parameters.json"
_BOARD, _OWN_CLOCK = "px4_boardconfig.h", "CONFIG_BOARD_NOLOCKSTEP 1"
_LOCKSTEP = "made with lockstep; in the loop PX4 has a clock of its own: `make px4_sitl_nolockstep`"
_GRIPPER = "CONFIG_MODULES_PAYLOAD_DELIVERER 1"


class Px4Error(ValueError):
    """PX4 cannot be run; the text is one line: what is wrong and what is required."""


def required(variable: str) -> str:
    """Return what --px4-dir, or the variable, must be."""
    build = _IN_SOURCES[variable]
    return (
        f"--px4-dir DIR or {variable}: a PX4 build directory with bin/px4 and etc/, as {build} "
        f"after `make {Path(build).name}`"
    )


class Range(NamedTuple):
    """Type and limits of a parameter in a build of PX4."""

    integer: bool
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class Px4Installation:
    """A PX4 build directory."""

    directory: Path

    @property
    def binary(self) -> Path:
        return self.directory / "bin" / "px4"

    @property
    def etc(self) -> Path:
        return self.directory / "etc"

    def ranges(self) -> dict[str, Range]:
        """Return type and limits of each parameter of the build; {} if it does not list them."""
        try:
            listed = json.loads((self.directory / _LISTED).read_text(encoding="utf-8"))[
                "parameters"
            ]
        except (OSError, ValueError, KeyError):
            return {}
        return {
            entry["name"]: Range(
                entry["type"] == "Int32", entry.get("min", -math.inf), entry.get("max", math.inf)
            )
            for entry in listed
        }

    def require_gripper(self) -> None:
        """Raise Px4Error if this build has no module that answers MAV_CMD_DO_GRIPPER.

        A build that does not tell passes.
        """
        self._require(
            _GRIPPER,
            "made without CONFIG_MODULES_PAYLOAD_DELIVERER: PX4 answers no gripper's command; "
            "choose a build with it, or `magnet: actuator`",
        )

    def _require(self, choice: str, otherwise: str) -> None:
        """Raise Px4Error, with what it is otherwise, if the build tells its choices without one."""
        try:
            board = (self.directory / _BOARD).read_text(encoding="utf-8")
        except OSError:
            return
        if board and choice not in board:
            raise Px4Error(f"{self.directory}: {otherwise}")

    @classmethod
    def find(cls, directory: str | Path | None = None, variable: str = VARIABLE) -> Px4Installation:
        """Return the build in `directory`, or in its place if PX4's sources are there.

        directory None: that of the variable. With LOOP_VARIABLE PX4's clock must not be the
        simulator's; a build that does not tell passes. Raises Px4Error.
        """
        given = directory or os.environ.get(variable)
        if not given:
            raise Px4Error(f"no PX4 build given: set {required(variable)}")
        base = Path(given).expanduser().absolute()
        for place in (base, base / _IN_SOURCES[variable]):
            found = cls(place)
            if os.access(found.binary, os.X_OK) and (place / _STARTUP).is_file():
                if variable == LOOP_VARIABLE:
                    found._require(_OWN_CLOCK, _LOCKSTEP)
                return found
        raise Px4Error(f"{given} holds no PX4 build: set {required(variable)}")
