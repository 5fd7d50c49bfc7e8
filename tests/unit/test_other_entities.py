"""Timers between two ticks: watchdogs at once, reports one after the other."""

from dataclasses import dataclass, field

import pytest

pytest.importorskip("rclpy")

from uam_msgs_py.node.other_entities import REPORT_PERIOD, OtherEntities


@dataclass
class Timer:
    timer_period_ns: int
    calls: int = 0
    handle: object = field(default=None)

    def __post_init__(self):
        self.handle = self

    def call_timer(self):
        self.calls += 1

    def callback(self):
        self.calls += 1


def test_of_the_reports_that_are_due_one_is_made_per_check():
    reports = [Timer(REPORT_PERIOD) for _ in range(3)]
    watchdog = Timer(20_000_000)
    ready = [reports[0], watchdog, *reports[1:]]
    for check in range(3):
        OtherEntities._call([one for one in ready if one is watchdog or not one.calls])
        assert [one.calls for one in reports] == [2] * (check + 1) + [0] * (2 - check)
    assert watchdog.calls == 6
