"""The result folder of a flight, and its files apart from logs and pictures."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import platform
import re
import subprocess
import sys
import weakref
from collections.abc import Mapping
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import yaml

from uam_control.settings.atomic import replacing, write_text
from uam_lab.records.results.metrics import plain

_of_process: dict[Path, FolderClaim] = {}  # claims of commands, to the end of this process
RESULTS = Path("results")
LATEST = "latest"
LOG, TABLE = "log.mcap", "timeseries.parquet"
PX4_LOG = "px4.ulg"  # of a flight with PX4 in software
# Distributions whose version can change a flight or its results.
DISTRIBUTIONS = (
    "uam",
    "mujoco",
    "numpy",
    "numba",
    "pymavlink",
    "ros-jazzy-rclpy",
    "ros-jazzy-common-interfaces",
    "mcap",
    "pyarrow",
    "matplotlib",
)


class ResultFolderError(ValueError):
    """The result folder cannot be used; the text is one line."""


class FolderClaim:
    """A lock (flock) of the folder itself, which needs no file. Ends with this object."""

    def __init__(self, path: Path) -> None:
        """Raises ResultFolderError, OSError. A file system without such locks has none."""
        opened = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self.release = weakref.finalize(self, os.close, opened)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise ResultFolderError(
                f"result folder {path} is in use: another flight or campaign writes to it; wait "
                "for its end, or give another --out"
            ) from None
        except OSError:
            self.release()


def claim(path: Path) -> FolderClaim:
    """Return a claim of the folder, that of this process if it has one."""
    return _of_process.get(path.resolve()) or FolderClaim(path)


def claim_for_process(path: Path) -> None:
    """Claim the folder to the end of this process; again is allowed."""
    _of_process[path.resolve()] = claim(path)


class ResultFolder:
    """The result folder of a flight. All files are written atomically."""

    def __init__(self, path: Path):
        self.path = path
        self.metrics = path / "metrics.json"
        self.timeseries = path / TABLE
        self.parameters = path / "parameters.yaml"
        self.versions = path / "versions.json"
        self.info = path / "info.json"
        self.log = path / LOG
        self._latest_before: str | None = None  # where results/latest pointed, None for nowhere
        self._claim: FolderClaim | None = None

    @classmethod
    def create(
        cls,
        scenario: str,
        controller: str,
        out: Path | None = None,
        now: datetime | None = None,
    ) -> ResultFolder:
        """Make `out`, or results/<time>-<scenario>-<controller>.

        scenario: name, or file whose stem is used. results/latest points at the new folder if that
        is in results/. Raises ResultFolderError: not writable, no directory, or `out` already
        contains a flight.
        """
        if out is not None:
            folder = cls(Path(out).expanduser())
            _usable(folder.path)
            folder.refuse_flight()
        else:
            folder = cls(make_folder(None, Path(scenario).stem, controller, now=now))
        folder.take()
        return folder

    def take(self) -> None:
        """Claim the folder for a flight; point results/latest at one in results/."""
        self._claim = claim(self.path)
        if self._link.parent.absolute() == RESULTS.absolute():
            if self._link.is_symlink():
                self._latest_before = os.readlink(self._link)
            _point(self._link, self.path.name)

    @property
    def _link(self) -> Path:
        return self.path.parent / LATEST

    def refuse_flight(self) -> None:
        """Raise ResultFolderError if there is a flight, or the report of many."""
        page = self.path / "report.html"
        if any(file.exists() for file in (self.metrics, self.timeseries, self.log, page)):
            raise ResultFolderError(
                f"result folder {self.path} already contains a flight or a report; give another "
                "--out"
            )

    def release(self) -> None:
        """Let another flight have the folder: nothing more is written to it."""
        if self._claim is not None:
            self._claim.release()

    def remove_if_empty(self) -> None:
        """Remove the folder of a refused flight, unless it has files; see `give_latest_back`."""
        for path in (self.path / "logs", self.path):
            with contextlib.suppress(OSError):
                path.rmdir()
        if not self.metrics.exists():
            self.give_latest_back()

    def give_latest_back(self) -> None:
        """Point results/latest where it pointed before this flight, which flew nothing."""
        link, before = self._link, self._latest_before
        if not link.is_symlink() or os.readlink(link) != self.path.name:
            return
        if before is not None and (link.parent / before).exists():
            _point(link, before)
        else:
            link.unlink()

    def write_parameters(self, parameters: Mapping[str, Any]) -> None:
        """Write the effective parameters, node by node, as a ROS parameter file."""
        document = {node: {"ros__parameters": plain(values)} for node, values in parameters.items()}
        write_text(self.parameters, yaml.safe_dump(document, sort_keys=False))


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file; the same value gives the same bytes."""
    write_text(path, as_json(value))


def read_json(file: Path) -> dict[str, Any]:
    """Return the content of a JSON file, a mapping. Raises ResultFolderError, OSError."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except ValueError:
        raise ResultFolderError(f"{file}: not valid JSON") from None
    if not isinstance(found, dict):
        raise ResultFolderError(f"{file}: a mapping expected")
    return found


def known_json(file: Path) -> dict[str, Any]:
    """Return the content of a JSON file that a program left; {} if it is missing or broken."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def as_json(value: Any) -> str:
    """Return indented JSON with a final newline; types as in `metrics.plain`, paths as text."""
    return json.dumps(plain(value), indent=2, allow_nan=False, default=str) + "\n"


def versions() -> dict[str, Any]:
    """Return the versions of python and packages, the git commit if any, and the platform."""
    packages = {}
    for name in DISTRIBUTIONS:
        try:
            packages[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            packages[name] = None
    return {
        "python": platform.python_version(),
        "packages": packages,
        "git_commit": git_commit(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "processors": os.cpu_count(),
    }


def git_commit(directory: Path | None = None) -> str | None:
    """Return the commit of the code's checkout, "+changes" if edited; None without git."""
    directory = directory or Path(__file__).resolve().parent

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(directory), *arguments]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=5, check=True, encoding="utf-8"
        )
        return done.stdout.strip()

    try:
        # code installed inside another checkout: that commit is not the version of this code
        if not git("ls-files", "--", str(directory)):
            return None
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "--short=12", "HEAD") + ("+changes" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None


def make_folder(
    out: Path | None,
    *words: str,
    now: datetime | None = None,
    shared: bool = False,
    parent: Path = RESULTS,
) -> Path:
    """Make `out`, or <time>-<words> in `parent`; return it. Raises ResultFolderError.

    `out` is this process's to its end, unless it is shared with others that do the same.
    """
    if out is not None:
        out = Path(out).expanduser()
        _usable(out)
        if not shared:
            claim_for_process(out)
        return out
    stamp = (now or datetime.now()).strftime("%Y%m%d-%H%M%S")
    return new_folder(parent, "-".join([stamp, *map(in_a_name, words)]))


def in_a_name(text: str) -> str:
    """Return the text with unusual characters replaced, for the name of a file."""
    return re.sub(r"[^A-Za-z0-9_.]+", "_", text).strip("._") or "flight"


def _usable(path: Path) -> None:
    """Make the directory and check that it is writable."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / f".writable.{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise _refusal(path, error) from None


def new_folder(parent: Path, name: str) -> Path:
    """Make a directory in `parent`; add a number if the name exists. Raises ResultFolderError."""
    try:
        parent.mkdir(parents=True, exist_ok=True)
        path, number = parent / name, 1
        while True:
            try:
                path.mkdir()
                return path
            except FileExistsError:
                number += 1
                path = parent / f"{name}-{number}"
    except OSError as error:
        raise _refusal(parent, error) from None


def _refusal(path: Path, error: OSError) -> ResultFolderError:
    reason = (error.strerror or str(error)).lower()
    return ResultFolderError(f"result folder {path} cannot be written: {reason}")


def _point(link: Path, name: str) -> None:
    """Point the link at `name` beside it; a file or folder of the link's name is kept."""
    if link.exists() and not link.is_symlink():
        print(f"{link} is no link and is not changed", file=sys.stderr)
        return
    try:
        with replacing(link) as temporary:
            temporary.symlink_to(name, target_is_directory=True)
    except OSError as error:
        print(f"{link} could not be set: {error.strerror}", file=sys.stderr)
