"""The page's frame rate follows the processor time that it costs."""

import pytest

from uam_lab.cockpit.cockpit_node import INTERVAL, REST, SHARE, FrameRate

FASTEST, SLOWEST = 0.04, 0.5


class Machine:
    """A page that costs `base` cores, and `frame` [s] for each frame."""

    def __init__(self, load, base, frame):
        self.load, self.base, self.frame = load, base, frame
        self.now = self.used = 0.0
        self.rate = FrameRate(
            FASTEST, SLOWEST, lambda: self.now, lambda: self.used, lambda: self.load
        )

    def run(self, seconds):
        end = self.now + seconds
        while self.now < end:
            self.now += self.rate.period
            self.used += self.base * self.rate.period + self.frame
            self.rate.measure()
        return self.rate


def test_on_an_idle_machine_it_is_fast():
    rate = Machine(load=0.5, base=0.05, frame=0.01).run(20.0)
    assert rate.period == FASTEST and not rate.sparing


def test_on_a_busy_machine_it_costs_less_than_a_tenth_of_a_core():
    machine = Machine(load=1.0, base=0.03, frame=0.01)
    assert machine.run(2.0 * INTERVAL).period > FASTEST
    rate = machine.run(20.0)
    assert FASTEST < rate.period < SLOWEST and rate.cores < 0.1 and not rate.sparing
    assert rate.cores == pytest.approx(SHARE, rel=0.2)


def test_what_the_slowest_rate_cannot_save_is_saved_by_fewer_messages():
    machine = Machine(load=1.0, base=0.2, frame=0.01)
    rate = machine.run(20.0)
    assert rate.period == SLOWEST and rate.sparing
    machine.base = 0.02
    assert machine.run(20.0).sparing, "still short: the messages stay away"
    machine.load = 0.3
    rate = machine.run((REST + 3) * INTERVAL)
    assert rate.period == FASTEST and not rate.sparing
