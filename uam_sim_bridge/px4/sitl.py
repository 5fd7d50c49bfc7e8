"""Executable `px4_sitl`: PX4 in software as the autopilot of a flight.

It runs in a new directory, so that no parameter of an earlier flight remains. It uses the ports of
its instance (TCP 4560 + N of the simulator, UDP 14580 + N) and the parameters of config/. PX4's log
(ULog) is saved on request. PX4's clock is the simulator's: PX4 waits for each HIL_SENSOR.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError, load_description
from uam_sim_bridge.mavlink.hil.sitl_options import add_instance, add_vehicle
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.px4_installation import REQUIRED, Px4Error, Px4Installation

PATIENCE = 2.0  # s between SIGINT and SIGKILL; PX4 cannot end while its clock is stopped
POLL = 0.05  # s
LOG_SUFFIX = ".ulg"
_PR_SET_PDEATHSIG = 1  # Linux's <sys/prctl.h>


class Sitl:
    """A running PX4. A context manager: stops PX4 at the end of the `with` block."""

    def __init__(
        self,
        installation: Px4Installation,
        instance: int,
        values: dict[str, parameters.Value],
        folder: Path,
    ) -> None:
        """Start PX4; values: parameters by name; folder: working directory, existing and empty."""
        surroundings = {k: v for k, v in os.environ.items() if not k.startswith("PX4_")}
        self._folder = folder
        self.process = subprocess.Popen(
            [str(installation.binary), "-i", str(instance), "-d", str(installation.etc)],
            cwd=folder,
            env=surroundings | parameters.environment(values),
            stdin=subprocess.DEVNULL,
            process_group=0,
            preexec_fn=_end_with_parent,
        )

    def logs(self) -> list[Path]:
        """Return PX4's log files, oldest first."""
        found = self._folder.glob(f"log/**/*{LOG_SUFFIX}")
        return sorted(found, key=lambda file: file.stat().st_mtime)

    def stop(self) -> None:
        """Send SIGINT, then SIGKILL: without a simulator PX4 does not end on SIGINT."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
            try:
                self.process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()

    def __enter__(self) -> Sitl:
        return self

    def __exit__(self, *exception) -> None:
        self.stop()


def _end_with_parent() -> None:
    """In the child process: end when the parent ends (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def keep(logs: Sequence[Path], target: Path) -> list[Path]:
    """Move PX4's logs to `target`, `target`-2, ...; return the new paths.

    PX4 writes one log per arming.
    """
    kept = []
    for number, log in enumerate(logs, 1):
        place = target if number == 1 else target.with_stem(f"{target.stem}-{number}")
        shutil.move(log, place)
        kept.append(place)
    return kept


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    p = argparse.ArgumentParser(
        prog="px4_sitl",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Run PX4 SITL with this vehicle's parameters, in a fresh directory, until it\n"
        "is interrupted. It waits for a simulator at TCP 4560 + N: mujoco_sim.",
        epilog="examples:\n"
        "  px4_sitl --px4-dir ~/PX4-Autopilot/build/px4_sitl_default\n"
        "  px4_sitl --instance 2 --log flight.ulg\n"
        "  px4_sitl --params mine.yaml       NAME: value lines, PX4's names\n",
    )
    add_instance(p)
    p.add_argument("--px4-dir", metavar="DIR", help=REQUIRED)
    add_vehicle(p)
    p.add_argument(
        "--params",
        metavar="FILE",
        nargs="+",
        help=f"parameters beside the vehicle's (default: {parameters.SIMULATION} of config/)",
    )
    p.add_argument(
        "--log",
        type=Path,
        metavar="FILE",
        help=f"save PX4's log as FILE{LOG_SUFFIX} (default: the log is deleted)",
    )
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run PX4 until interrupted; return the exit status.

    0: interrupted; PX4's status if PX4 ended by itself; 2: no PX4 or wrong use.
    """
    options = parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        installation = Px4Installation.find(options.px4_dir)
        values = parameters.load(load_description(options.vehicle), options.params)
    except (Px4Error, ConfigurationError, VehicleError) as error:
        print(f"px4_sitl: {error}", file=sys.stderr, flush=True)
        return 2
    with tempfile.TemporaryDirectory(prefix="uam-px4-") as folder:
        px4 = Sitl(installation, options.instance, values, Path(folder))
        try:
            with px4:
                while px4.process.poll() is None:
                    time.sleep(POLL)
            status = px4.process.returncode
            print(f"px4_sitl: PX4 ended with exit status {status}", file=sys.stderr, flush=True)
            return status or 1
        except KeyboardInterrupt:
            return 0
        finally:
            if options.log is not None:
                kept = keep(px4.logs(), options.log)
                names = ", ".join(str(file) for file in kept) or "PX4 wrote none"
                print(f"px4_sitl: log: {names}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
