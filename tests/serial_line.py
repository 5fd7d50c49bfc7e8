"""A serial line of two pseudo-terminals."""

import os
import select
import threading
import tty


class SerialLine:
    """Two pseudo-terminals joined end to end: `near` and `far` are what two programs open."""

    def __init__(self):
        pairs = [os.openpty() for _ in range(2)]
        for _, slave in pairs:
            tty.setraw(slave)
        self._ends = pairs
        self.near, self.far = (os.ttyname(slave) for _, slave in pairs)
        self._stop, self._wake = os.pipe()
        self._pump = threading.Thread(target=self._carry, daemon=True)
        self._pump.start()

    def _carry(self):
        (one, _), (other, _) = self._ends
        there = {one: other, other: one}
        while True:
            readable = select.select([one, other, self._stop], [], [])[0]
            if self._stop in readable:
                return
            for end in readable:
                os.write(there[end], os.read(end, 4096))

    def close(self):
        os.write(self._wake, b".")
        self._pump.join()
        for end in (*self._ends[0], *self._ends[1], self._stop, self._wake):
            os.close(end)
