"""Finds a PX4 SITL build in the directory that the user gives. This project contains no PX4."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

VARIABLE = "PX4_SITL_DIR"
LOOP_VARIABLE = "PX4_HITL_DIR"  # a build without lockstep, for px4_hitl and uam rehearse
REQUIRED = (
    f"--px4-dir DIR or {VARIABLE}: a PX4 build directory with bin/px4 and etc/, "
    "as build/px4_sitl_default after `make px4_sitl_default`"
)
_REQUIRED_IN_LOOP = (
    f"--px4-dir DIR or {LOOP_VARIABLE}: a PX4 build directory, as build/px4_sitl_nolockstep after "
    "`make px4_sitl_nolockstep`"
)
_STARTUP = "etc/init.d-posix/rcS"
_LISTED = "parameters.json"
_BOARD, _OWN_CLOCK = "px4_boardconfig.h", "CONFIG_BOARD_NOLOCKSTEP 1"
_GRIPPER = "CONFIG_MODULES_PAYLOAD_DELIVERER 1"
_WITH_LOCKSTEP, _IN_LOOP = "build/px4_sitl_default", "build/px4_sitl_nolockstep"  # in the sources


class Px4Error(ValueError):
    """PX4 cannot be run; the text is one line: what is wrong and what is required."""


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

    def require_own_clock(self) -> None:
        """Raise Px4Error if PX4's clock is the simulator's: this build is made with lockstep.

        A build that does not tell passes.
        """
        self._require(
            _OWN_CLOCK,
            "made with lockstep; in the loop PX4 has a clock of its own: "
            "`make px4_sitl_nolockstep`",
        )

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
    def in_the_loop(cls, directory: str | Path | None = None) -> Px4Installation:
        """Return the build without lockstep in `directory`; None: that of PX4_HITL_DIR.

        For PX4's source directory it returns the build in build/px4_sitl_nolockstep. Raises
        Px4Error.
        """
        given = directory or os.environ.get(LOOP_VARIABLE)
        found = cls._found(given, _IN_LOOP, _REQUIRED_IN_LOOP)
        found.require_own_clock()
        return found

    @classmethod
    def find(cls, directory: str | Path | None = None) -> Px4Installation:
        """Return the build in `directory`; None: in the directory of the variable PX4_SITL_DIR.

        For PX4's source directory it returns the build in build/px4_sitl_default. Raises Px4Error.
        """
        return cls._found(directory or os.environ.get(VARIABLE), _WITH_LOCKSTEP, REQUIRED)

    @classmethod
    def _found(cls, given: str | Path | None, in_sources: str, required: str) -> Px4Installation:
        if not given:
            raise Px4Error(f"no PX4 build given: set {required}")
        base = Path(given).expanduser().absolute()
        for place in (base, base / in_sources):
            found = cls(place)
            if os.access(found.binary, os.X_OK) and (place / _STARTUP).is_file():
                return found
        raise Px4Error(f"{given} holds no PX4 build: set {required}")
