"""The deadlines of the bus cycles, on a clock that the test moves."""

from __future__ import annotations

import pytest

from uam_sim_bridge.drivers.dynamixel.cycle_pace import CyclePace


class Bus:
    """Cycles of given lengths [s]; `begun`: when each began."""

    def __init__(self):
        self.now, self.begun = 0.0, []
        self.pace = CyclePace(250.0, clock=lambda: self.now)

    def run(self, *lengths):
        for length in lengths:
            self.begun.append(self.now)
            self.now += length
            self.now += self.pace.left()
        return self.now


def test_cycles_begin_at_absolute_deadlines():
    bus = Bus()
    bus.run(*[0.001, 0.003] * 50)
    assert bus.begun == pytest.approx([0.004 * k for k in range(100)])


def test_late_cycles_do_not_lower_the_rate():
    """Three of four take longer than a period, but not on the average."""
    bus = Bus()
    assert bus.run(*[0.005, 0.005, 0.005, 0.001] * 50) == pytest.approx(0.8, abs=0.004)


def test_a_stall_is_not_made_up_for_by_a_burst():
    bus = Bus()
    bus.run(0.5, *[0.001] * 10)
    assert bus.begun[1:] == pytest.approx([0.5 + 0.004 * k for k in range(10)])
    assert bus.begun[0] == 0.0
