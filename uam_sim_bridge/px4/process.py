"""A PX4 program of a build: a new working directory, its own scripts, its log kept."""

from __future__ import annotations

import argparse
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError
from uam_sim_bridge.mavlink.hil.sitl_ports import Program
from uam_sim_bridge.ports import PortError
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.px4_installation import Px4Error, Px4Installation

PATIENCE = 2.0  # s between SIGINT and SIGKILL; PX4 cannot end while its clock is stopped
LOG_SUFFIX = ".ulg"
FOLDERS = "uam-px4-"  # beginning of the names of working directories
_PR_SET_PDEATHSIG = 1  # Linux's <sys/prctl.h>


class Px4Process:
    """A running PX4. A context manager: stops PX4 at the end of the `with` block."""

    def __init__(
        self,
        installation: Px4Installation,
        instance: int,
        scripts: Mapping[str, str],
        variables: Mapping[str, str],
        folder: Path,
    ) -> None:
        """Start PX4; scripts: name → text, found before PX4's own; variables: of the environment;
        folder: working directory, existing and empty."""
        surroundings = {k: v for k, v in os.environ.items() if not k.startswith("PX4_")}
        self._folder = folder
        own = folder / "scripts"
        own.mkdir()
        for name, text in scripts.items():
            (own / name).write_text(text, encoding="utf-8")
        surroundings["PATH"] = os.pathsep.join((str(own), surroundings.get("PATH", os.defpath)))
        # files that PX4 makes outside its working directory, and leaves if it is killed
        self._files = [Path(f"/tmp/{name}-{instance}") for name in ("px4-sock", "px4_lock")]
        self._foreign = [_identity(file) for file in self._files]
        self.process = subprocess.Popen(
            [str(installation.binary), "-i", str(instance), "-d", str(installation.etc)],
            cwd=folder,
            env=surroundings | dict(variables),
            stdin=subprocess.DEVNULL,
            process_group=0,
            preexec_fn=_end_with_parent,
        )

    def logs(self) -> list[Path]:
        """Return PX4's log files, oldest first."""
        found = self._folder.glob(f"log/**/*{LOG_SUFFIX}")
        return sorted(found, key=lambda file: file.stat().st_mtime)

    def stop(self) -> None:
        """Send SIGINT, then SIGKILL: without a simulator PX4 does not end on SIGINT.

        Then remove the files that PX4 has made outside its working directory.
        """
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
            os.killpg(self.process.pid, signal.SIGCONT)  # a fault may have stopped it
            try:
                self.process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()
        for file, foreign in zip(self._files, self._foreign, strict=True):
            if _identity(file) != foreign:
                file.unlink(missing_ok=True)

    def __enter__(self) -> Px4Process:
        return self

    def __exit__(self, *exception) -> None:
        self.stop()


def _identity(file: Path) -> tuple[int, int] | None:
    """Return inode and time of change of a file, None if it does not exist."""
    try:
        found = file.lstat()
    except FileNotFoundError:
        return None
    return found.st_ino, found.st_mtime_ns


def _end_with_parent() -> None:
    """In the child process: end when the parent ends (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def keep(logs: Sequence[Path], target: Path, first: int = 1) -> list[Path]:
    """Move PX4's logs to `target`, `target`-2, ..., from number `first` on; return the new paths.

    PX4 writes one log per arming.
    """
    kept = []
    for number, log in enumerate(logs, first):
        place = target if number == 1 else target.with_stem(f"{target.stem}-{number}")
        shutil.move(log, place)
        kept.append(place)
    return kept


def end_of(status: int) -> str:
    """Return a return code of subprocess in words."""
    if status >= 0:
        return f"ended by itself with exit status {status}"
    return f"was ended by {signal.Signals(-status).name}"


def ended(program: str, status: int) -> int:
    """Say that PX4 has ended by itself with `status`; return the exit status of `program`.

    If a signal ended PX4, the same signal ends this process.
    """
    print(f"{program}: PX4 {end_of(status)}", file=sys.stderr, flush=True)
    if status < 0:
        if -status != signal.SIGKILL:
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    return status or 1


def say_kept(program: str, kept: Sequence[Path]) -> None:
    names = ", ".join(str(file) for file in kept) or "PX4 wrote none"
    print(f"{program}: log: {names}", flush=True)


def end_of_all(px4: Px4Process) -> bool:
    """Wait until PX4 has ended; return that none is started after it."""
    px4.process.wait()
    return False


class How(NamedTuple):
    """How PX4 runs; by default it is not started anew."""

    start: Callable[[Path], Px4Process]  # returns a running PX4 in the given new folder
    log: Path | None  # where its logs are kept, if at all
    over: Callable[[Px4Process], bool] = end_of_all  # waits for the end; True: PX4 starts anew
    anew: str = ""  # said then


def command(
    program: str, options: argparse.Namespace, prepared: Callable[[argparse.Namespace], How]
) -> int:
    """Run PX4 until interrupted; return the exit status of `program`.

    0: interrupted; PX4's status if PX4 ended by itself; 2: no PX4 or wrong use. If a signal ended
    PX4, the same signal ends this process.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        how = prepared(options)
    except (Px4Error, ConfigurationError, VehicleError, PortError) as error:
        print(f"{program}: {error}", file=sys.stderr, flush=True)
        return 2
    kept: list[Path] = []
    again = True
    while again:
        with tempfile.TemporaryDirectory(prefix=FOLDERS) as folder:
            px4 = how.start(Path(folder))
            try:
                with px4:
                    again = how.over(px4)
                status = px4.process.returncode
            except KeyboardInterrupt:
                return 0
            finally:
                if how.log is not None:
                    kept += (new := keep(px4.logs(), how.log, len(kept) + 1))
                    say_kept(program, new)
        if again:
            print(f"{program}: {how.anew}", flush=True)
    return ended(program, status)


def add_px4_options(p: Program, required: str) -> None:
    """Add the options of every program that runs a PX4; required: what --px4-dir must be."""
    p.option("--px4-dir", "DIR", required)
    text = f"parameters beside the vehicle's (default: {parameters.SIMULATION} of config/)"
    p.option("--params", "FILE", text, nargs="+")
    text = "a parameter of PX4, in place of the files' (repeatable)"
    p.add_argument("--param", metavar="NAME=VALUE", action="append", default=[], help=text)
    text = f"save PX4's log as FILE{LOG_SUFFIX} (default: the log is deleted)"
    p.option("--log", "FILE", text, type=Path)
