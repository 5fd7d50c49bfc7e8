"""The package `motioncapture` (libmotioncapture): Vicon, Qualisys, VRPN, OptiTrack and others.

It runs in a process of its own: its calls wait for the next frame without limit, and a fault in the
vendor's code must not end the driver. The library gives neither stamps nor numbers of frames.
"""

import importlib.util
import json
import os
import select
import subprocess
import sys
import time

import numpy as np

from uam_sim_bridge.devices import INSTALL
from uam_sim_bridge.devices.mocap.frame import BodyPose, Frame, MocapError

PROGRAM = "uam_sim_bridge.devices.mocap.library_source"
SYSTEMS = (
    "vicon",
    "qualisys",
    "vrpn",
    "optitrack",
    "nokov",
    "fzmotion",
    "motionanalysis",
    "mock",
)
RESTART_PERIOD = 2.0  # [s] between two attempts
SILENCE = 1.5  # [s] without a frame after which the system counts as not connected
END_TIME = 2.0  # [s] for the process to end


class LibrarySource:
    """A `MocapSource`. The names are those of the bodies that have been seen."""

    def __init__(self, system: str, server: str, local: str = "", port: int = 1510) -> None:
        """system: of SYSTEMS; server: its computer; local: own address in its network; port: of
        commands. Only OptiTrack has the last two. Raises MocapError."""
        if importlib.util.find_spec("motioncapture") is None:
            raise MocapError(f"source motioncapture needs the package motioncapture: {INSTALL}")
        options = {"hostname": server}
        if system == "optitrack":
            options |= {"port_command": str(port)} | ({"interface_ip": local} if local else {})
        self._command = [sys.executable, "-m", PROGRAM, system, json.dumps(options)]
        self.description = f"{system} at {server}, by motioncapture"
        self._process: subprocess.Popen | None = None
        self._begun = self._heard = -np.inf  # time.monotonic() [s]
        self._seen: dict[str, None] = {}
        self._rest = b""
        self.bad = self.sessions = 0
        self.failure = ""  # why the process ended

    @property
    def connected(self) -> bool:
        """Whether frames arrive."""
        return time.monotonic() - self._heard < SILENCE

    @property
    def names(self) -> tuple[str, ...] | None:
        """Names of the bodies seen so far; None before the first frame."""
        return tuple(self._seen) or None

    def frames(self, timeout: float) -> list[Frame]:
        """Return the frames that have arrived; wait at most `timeout` [s] for the first."""
        process = self._running()
        if process is None:
            time.sleep(timeout)
            return []
        if not select.select([process.stdout], [], [], timeout)[0]:
            return []
        data = process.stdout.read1(1 << 16)
        if not data:
            self.failure = _last_line(process.stderr.read())
            self.close()
            return []
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [frame for line in lines if (frame := self._frame(line)) is not None]

    def _running(self) -> subprocess.Popen | None:
        now = time.monotonic()
        if self._process is None and now - self._begun >= RESTART_PERIOD:
            self._begun, self._rest = now, b""
            self._process = subprocess.Popen(
                self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=-1
            )
            self.sessions += 1
        return self._process

    def _frame(self, line: bytes) -> Frame | None:
        """Read a line of the process; what the library itself prints is ignored."""
        try:
            arrival, bodies = json.loads(line)
            poses = {name: _pose(*numbers) for name, numbers in bodies.items()}
        except (ValueError, TypeError, AttributeError):
            self.bad += 1
            return None
        self._heard = time.monotonic()
        self._seen |= dict.fromkeys(poses)
        return Frame(arrival, None, None, None, dict.fromkeys(self._seen) | poses)

    def close(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait(END_TIME)
        process.stdout.close()
        process.stderr.close()


def _pose(x: float, y: float, z: float, qw: float, qx: float, qy: float, qz: float) -> BodyPose:
    position, quaternion = np.array([x, y, z]), np.array([qw, qx, qy, qz])
    norm = np.sqrt(quaternion @ quaternion)
    if not (np.isfinite(position.sum()) and 0.9 < norm < 1.1):
        raise ValueError("not a pose")
    return BodyPose(position, quaternion / norm)


def _last_line(text: bytes) -> str:
    lines = text.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "ended without a word"


def main() -> int:
    """Print one line of JSON per frame until the output is closed; return the exit status.

    [arrival in ns, {"body": [x, y, z, qw, qx, qy, qz], ...}]; arguments: kind of system, its
    options in JSON.
    """
    import motioncapture

    system, options = sys.argv[1:3]
    # the library prints on standard output itself
    lines = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1, encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        connection = motioncapture.connect(system, json.loads(options))
        while True:
            connection.waitForNextFrame()
            arrival = time.time_ns()
            bodies = {
                name: [*map(float, body.position), q.w, q.x, q.y, q.z]
                for name, body in connection.rigidBodies.items()
                for q in [body.rotation]
            }
            print(json.dumps([arrival, bodies]), file=lines)
    except (RuntimeError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
