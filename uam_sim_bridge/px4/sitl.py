"""Executable `px4_sitl`: PX4 in software as the autopilot of a flight.

It runs in a new directory, so that no parameter of an earlier flight remains. It uses the ports of
its instance (TCP 4560 + N of the simulator, UDP 14580 + N) and the parameters of config/. PX4's log
(ULog) is saved on request, also if PX4 ends early. PX4's clock is the simulator's: PX4 waits for
each HIL_SENSOR. PX4 never connects again after the simulator has hung up: this program then starts
it anew for the next simulator.
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

import psutil

from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError, load_description
from uam_sim_bridge.mavlink.hil.sitl_options import add_instance, add_vehicle
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.ports import SIMULATOR_TCP
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.px4_installation import REQUIRED, Px4Error, Px4Installation

PATIENCE = 2.0  # s between SIGINT and SIGKILL; PX4 cannot end while its clock is stopped
POLL, LOOK = 0.05, 0.5  # s between two looks at PX4, and at its connection
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
        host: str = HOST,
    ) -> None:
        """Start PX4; values: parameters by name; folder: working directory, existing and empty;
        host: of the simulator."""
        surroundings = {k: v for k, v in os.environ.items() if not k.startswith("PX4_")}
        self._folder = folder
        scripts = folder / "scripts"
        scripts.mkdir()
        (scripts / parameters.STARTED_LATE).write_text(parameters.start_script(values))
        surroundings["PATH"] = os.pathsep.join((str(scripts), surroundings.get("PATH", os.defpath)))
        # files that PX4 makes outside its working directory, and leaves if it is killed
        self._files = [Path(f"/tmp/{name}-{instance}") for name in ("px4-sock", "px4_lock")]
        self._foreign = [_identity(file) for file in self._files]
        self.process = subprocess.Popen(
            [str(installation.binary), "-i", str(instance), "-d", str(installation.etc)],
            cwd=folder,
            env=surroundings | parameters.environment(values) | {"PX4_SIM_HOSTNAME": host},
            stdin=subprocess.DEVNULL,
            process_group=0,
            preexec_fn=_end_with_parent,
        )

    def until_over(self, port: int | None) -> bool:
        """Wait until PX4 has ended (False), or its simulator at TCP `port` has hung up (True).

        port None: only until PX4 has ended.
        """
        met, look = False, 0.0
        while self.process.poll() is None:
            time.sleep(POLL)
            if port is None or time.monotonic() < look:
                continue
            look = time.monotonic() + LOOK
            connected = _connected(self.process.pid, port)
            if met and not connected:
                return True
            met = met or connected
        return False

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

    def __enter__(self) -> Sitl:
        return self

    def __exit__(self, *exception) -> None:
        self.stop()


def _connected(pid: int, port: int) -> bool:
    """Return whether a process has an open connection to a TCP port."""
    try:
        sockets = psutil.Process(pid).net_connections("tcp")
    except psutil.Error:
        return False
    return any(
        one.raddr and one.raddr.port == port and one.status == psutil.CONN_ESTABLISHED
        for one in sockets
    )


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
        "  px4_sitl --params mine.yaml       NAME: value lines, PX4's names\n"
        "  px4_sitl --param COM_OF_LOSS_T=1.0 --param SDLOG_MODE=0\n",
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
        "--param",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="a parameter of PX4, in place of the files' (repeatable)",
    )
    p.add_argument(
        "--sim-host", default=HOST, metavar="HOST", help="simulator (default %(default)s)"
    )
    p.add_argument(
        "--once",
        action="store_true",
        help="serve one simulator (default: start PX4 anew for the next one)",
    )
    p.add_argument(
        "--log",
        type=Path,
        metavar="FILE",
        help=f"save PX4's log as FILE{LOG_SUFFIX} (default: the log is deleted)",
    )
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run PX4 until interrupted, anew for each simulator; return the exit status.

    0: interrupted; PX4's status if PX4 ended by itself; 2: no PX4 or wrong use. If a signal ended
    PX4, the same signal ends this process.
    """
    options = parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        installation = Px4Installation.find(options.px4_dir)
        vehicle = load_description(options.vehicle)
        values = parameters.load(vehicle, options.params, options.param, installation.ranges())
    except (Px4Error, ConfigurationError, VehicleError) as error:
        print(f"px4_sitl: {error}", file=sys.stderr, flush=True)
        return 2
    port = None if options.once else SIMULATOR_TCP + options.instance
    kept: list[Path] = []
    hung_up = True
    while hung_up:
        with tempfile.TemporaryDirectory(prefix="uam-px4-") as folder:
            px4 = Sitl(installation, options.instance, values, Path(folder), options.sim_host)
            try:
                with px4:
                    hung_up = px4.until_over(port)
                status = px4.process.returncode
            except KeyboardInterrupt:
                return 0
            finally:
                if options.log is not None:
                    kept += (new := keep(px4.logs(), options.log, len(kept) + 1))
                    names = ", ".join(str(file) for file in new) or "PX4 wrote none"
                    print(f"px4_sitl: log: {names}", flush=True)
        if hung_up:
            print("px4_sitl: the simulator hung up; PX4 starts anew for the next one", flush=True)
    print(f"px4_sitl: PX4 {end_of(status)}", file=sys.stderr, flush=True)
    if status < 0:
        if -status != signal.SIGKILL:
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    return status or 1


def end_of(status: int) -> str:
    """Return a return code of subprocess in words."""
    if status >= 0:
        return f"ended by itself with exit status {status}"
    return f"was ended by {signal.Signals(-status).name}"


if __name__ == "__main__":
    sys.exit(main())
