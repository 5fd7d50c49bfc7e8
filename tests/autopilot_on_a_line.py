"""The stand-in autopilot of a vehicle at rest, at the far end of a pseudo-terminal, in a thread."""

from __future__ import annotations

import os
import pty
import select
import threading
import time
import tty
from pathlib import Path

import numpy as np

from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer

PERIOD = 0.004  # [s]
AT_REST = np.zeros(3), np.array([0.0, 0.0, -9.81])  # gyro, specific force, FRD


class AutopilotOnALine:
    """`link`: the device; made when the autopilot is there, removed with it."""

    def __init__(self, link: Path) -> None:
        self._own, far = pty.openpty()
        tty.setraw(far)
        os.set_blocking(self._own, False)
        self._far, self.link = far, link
        link.symlink_to(os.ttyname(far))
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        autopilot, codec = Autopilot(), Codec(1, 1)
        companion, framer = Companion(autopilot), Framer(codec)
        begun = due = time.monotonic()
        while not self._ending.is_set():
            now = time.monotonic() - begun
            while select.select([self._own], [], [], 0.0)[0]:
                for message in framer.take(os.read(self._own, 65536), True):
                    companion.handle(now, message)
            autopilot.update(now, *AT_REST)
            for message in companion.tick(now):
                try:
                    os.write(self._own, codec.encode(message))
                except BlockingIOError:  # nobody reads: the line is full
                    break
            due = max(due + PERIOD, time.monotonic() - 0.1)
            time.sleep(max(0.0, due - time.monotonic()))

    def close(self) -> None:
        """Unplug it; no effect the second time."""
        if self._ending.is_set():
            return
        self._ending.set()
        self._thread.join()
        self.link.unlink()
        os.close(self._own)
        os.close(self._far)
