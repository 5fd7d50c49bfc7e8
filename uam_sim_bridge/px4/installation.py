"""Where PX4 is: a build directory of PX4 SITL that the user points at. None is contained here."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

VARIABLE = "PX4_SITL_DIR"
WANTED = (
    f"--px4-dir DIR or {VARIABLE}: a PX4 build directory with bin/px4 and etc/, "
    "as build/px4_sitl_default after `make px4_sitl_default`"
)
_STARTUP = "etc/init.d-posix/rcS"
_IN_SOURCES = "build/px4_sitl_default"


class Px4Error(ValueError):
    """No PX4 can be run; the text is one line and says what is wanted."""


@dataclass(frozen=True)
class Px4Installation:
    """A PX4 build directory."""

    directory: Path

    @property
    def binary(self) -> Path:
        """The program."""
        return self.directory / "bin" / "px4"

    @property
    def etc(self) -> Path:
        """Its start-up scripts."""
        return self.directory / "etc"

    @classmethod
    def find(cls, directory: str | Path | None = None) -> Px4Installation:
        """Return the build in `directory`, by default that of the environment variable.

        PX4's source directory is taken for the build in it. Raises Px4Error.
        """
        given = directory or os.environ.get(VARIABLE)
        if not given:
            raise Px4Error(f"no PX4 to fly with: give {WANTED}")
        base = Path(given).expanduser().absolute()
        for place in (base, base / _IN_SOURCES):
            found = cls(place)
            if os.access(found.binary, os.X_OK) and (place / _STARTUP).is_file():
                return found
        raise Px4Error(f"{given} holds no PX4 build; give {WANTED}")
