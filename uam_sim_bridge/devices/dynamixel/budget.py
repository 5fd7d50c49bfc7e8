"""Time budget of the bus: bytes of a cycle, delays, and the highest rate.

A cycle writes the goals (Sync Write), reads current, velocity and position (Sync Read), and now and
then one slow block of one servo. Source of the packet lengths: ROBOTIS e-manual, Protocol 2.0.
"""

from dataclasses import dataclass

BITS_PER_BYTE = 10
INSTRUCTION = 10  # bytes of an instruction packet without parameters
STATUS = 11  # bytes of a status packet without parameters
SLOW_BLOCK = 7  # bytes of the longest slow block


@dataclass(frozen=True)
class Item:
    """One part of a cycle: bytes on the wire, and waits [s] beside them."""

    name: str
    sent: int
    received: int
    waits: float

    def duration(self, baud_rate: int) -> float:
        """Return its time [s]."""
        return BITS_PER_BYTE * (self.sent + self.received) / baud_rate + self.waits


# place and length of the goal, id, goal position
GRIPPER_GOAL = Item("Sync Write, goal of the gripper", INSTRUCTION + 2 + 2 + 1 + 4, 0, 0.0)


@dataclass(frozen=True)
class Budget:
    """The parts of a cycle at a baud rate; `slow_every`: cycles per slow read."""

    baud_rate: int
    items: tuple[Item, ...]
    slow: Item
    slow_every: int

    @property
    def cycle(self) -> float:
        """Time [s] of a cycle without the slow read."""
        return sum(item.duration(self.baud_rate) for item in self.items)

    @property
    def longest(self) -> float:
        """Time [s] of a cycle with the slow read."""
        return self.cycle + self.slow.duration(self.baud_rate)

    @property
    def rate(self) -> float:
        """Rate [Hz] at which even the longest cycle fits."""
        return 1.0 / self.longest

    def load(self, rate: float) -> float:
        """Return the mean share of the time in which the bus is busy, 0..1, at `rate` [Hz]."""
        return rate * (self.cycle + self.slow.duration(self.baud_rate) / self.slow_every)

    def table(self, rate: float) -> str:
        """Return the budget as a table for people; rate [Hz]: of the control loop."""
        head = f"{'part of a cycle':<34}{'bytes out':>10}{'bytes in':>10}{'waits us':>10}{'us':>8}"
        rows = [
            f"{item.name:<34}{item.sent:>10}{item.received:>10}{1e6 * item.waits:>10.0f}"
            f"{1e6 * item.duration(self.baud_rate):>8.0f}"
            for item in (*self.items, self.slow)
        ]
        fits = "fits" if self.rate >= rate else "DOES NOT FIT"
        load = 100 * self.load(rate)
        return "\n".join(
            [
                head,
                *rows,
                f"longest cycle {1e6 * self.longest:.0f} us: up to {self.rate:.0f} Hz at "
                f"{self.baud_rate} baud; {rate:g} Hz {fits}, bus load {load:.0f} %",
            ]
        )


def budget(
    servos: int,
    baud_rate: int,
    return_delay: float,
    latency_timer: float,
    fast: bool,
    slow_every: int,
    goal: int = 2,
    state: int = 10,
) -> Budget:
    """Return the budget.

    servos: their number; return_delay [s]; latency_timer [s] of the adapter, 0 without one; fast:
    Fast Sync Read; slow_every: cycles per slow read; goal, state: bytes per servo.
    """
    write = Item("Sync Write of the goals", INSTRUCTION + 4 + servos * (1 + goal), 0, 0.0)
    request = INSTRUCTION + 4 + servos
    if fast:
        answer, delays = 8 + servos * (state + 4), return_delay
    else:
        answer, delays = servos * (STATUS + state), servos * return_delay
    name = f"{'Fast ' if fast else ''}Sync Read of the states"
    read = Item(name, request, answer, delays + latency_timer)
    slow = Item(
        f"slow read, every {slow_every} cycles",
        INSTRUCTION + 4,
        STATUS + SLOW_BLOCK,
        return_delay + latency_timer,
    )
    return Budget(baud_rate, (write, read), slow, slow_every)
