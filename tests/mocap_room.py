"""A motion capture system in a thread of its own, with what may happen to it and to its frames."""

import random
import threading
import time
from dataclasses import dataclass

from uam_sim_bridge.devices.mocap.emulated.mocap_server import MocapServer


@dataclass
class Disturbances:
    """What happens to frames; may be changed while the server runs.

    loss, repeat, swap: probability per frame that it is lost, sent twice, or overtaken by the next;
    damage: that a byte of it is changed.
    """

    loss: float = 0.0
    repeat: float = 0.0
    swap: float = 0.0
    damage: float = 0.0


class MocapRoom(MocapServer):
    """poses(time): name → position (3,) and quaternion (4,) of the vehicle at `time` [s] of the
    host's clock; a body without a pose is not tracked."""

    def __init__(self, bodies, poses, streaming=None, disturbances=None, seed=0):
        super().__init__(bodies, streaming)
        self.disturbances = disturbances or Disturbances()
        self._random, self._poses = random.Random(seed), poses
        self._paused = poses is None
        self._posing = threading.Thread(target=self._pose, daemon=True)

    def start(self):
        super().start()
        self._posing.start()

    def stop(self):
        self._ended.set()
        if self._posing.ident is not None:
            self._posing.join()
        super().stop()

    def _pose(self):
        while not self._ended.wait(0.0005):
            now = time.time()
            if not self._paused:
                self.expose(now, self._poses(now))

    def pause(self, paused=True):
        """Stop the frames, not the server."""
        self._paused = paused

    def remove(self, name):
        """Delete a body."""
        with self._lock:
            self._bodies = {n: body for n, body in self._bodies.items() if body.name != name}
            self._seen.clear()
            self._changed = True

    def _send_at(self, due, data):
        d, chance = self.disturbances, self._random.random
        if chance() < d.damage:
            at = self._random.randrange(4, len(data))
            data = data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :]
        if chance() < d.loss:
            return
        if chance() < d.swap:
            due += 1.5 * self._period
        for _ in range(2 if chance() < d.repeat else 1):
            super()._send_at(due, data)
