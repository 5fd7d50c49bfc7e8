"""Tick times: every moment belongs to one part; the newest ticks are kept."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from uam_control.settings.process_parameters import TickTimesParameters
from uam_msgs_py.messages import topics
from uam_msgs_py.node import tick_times as module
from uam_msgs_py.node.tick_times import (
    DECODE,
    PARTS,
    STAGE,
    TAKE,
    NoTickTimes,
    TickTimes,
    read_tick_times,
    tick_times,
)


class Clock:
    """A monotonic clock that the test advances [ns]."""

    def __init__(self):
        self.now = 1_000

    def monotonic_ns(self) -> int:
        return self.now

    def after(self, duration: int) -> "Clock":
        self.now += duration
        return self


class Publisher:
    """Takes `duration` [ns] to publish."""

    def __init__(self, clock: Clock, duration: int):
        self._clock, self._duration = clock, duration

    def publish(self, message) -> None:
        self._clock.after(self._duration)


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(module, "time", made)
    return made


def one_tick(times: TickTimes, clock: Clock, state: Publisher, other: Publisher, stamp: int):
    """Take 20, decode 30, stage 400, encode 50, publish 60, encode 5, another topic 7, rest 8."""
    clock.after(1000)
    times.woken()
    clock.after(20)
    times.lap(TAKE)
    clock.after(30)
    times.lap(DECODE)
    clock.after(400)
    times.lap(STAGE)
    clock.after(50)
    state.publish(b"")
    clock.after(5)
    other.publish(b"")
    clock.after(8)
    times.tick(stamp)


def test_a_tick_by_hand(tmp_path, clock):
    times = TickTimes(tmp_path / "times.npz", 10)
    state, other = Publisher(clock, 60), Publisher(clock, 7)
    times.watch(state, topics.STATE)
    times.watch(other, topics.IMU_BIAS)
    one_tick(times, clock, state, other, 4_000_000)
    clock.after(90)
    times.rest()  # 90 after the tick, as diagnostics
    one_tick(times, clock, state, other, 8_000_000)
    times.close()
    found = read_tick_times(tmp_path / "times.npz")
    assert found["stamp"].tolist() == [4_000_000, 8_000_000]
    assert [found[part].tolist() for part in PARTS] == [
        *([20, 20], [30, 30], [400, 400]),
        *([63, 63], [67, 67]),  # encode 50 + 5 + 8, publish 60 + 7
    ]
    until = [found[f"{part} until sending"].tolist()[0] for part in PARTS]
    assert until == [20, 30, 400, 50, 0]
    woken = found["woken"]
    assert (found["sending"] - woken).tolist() == [500, 500]
    assert (found["sent"] - woken).tolist() == [560, 560]
    assert (found["done"] - woken).tolist() == [580, 580]
    assert found["before"].tolist()[1] == 90


def test_a_wake_up_without_a_tick_is_work_before_the_next_one(tmp_path, clock):
    times = TickTimes(tmp_path / "times.npz", 10)
    times.woken()
    clock.after(11)
    times.lap(TAKE)
    clock.after(2)
    times.rest()
    clock.after(500)  # waits
    times.woken()
    clock.after(3)
    times.lap(STAGE)
    times.tick(1)
    times.close()
    found = read_tick_times(tmp_path / "times.npz")
    assert found["before"].tolist() == [13]
    assert found["stage"].tolist() == [3] and found["take"].tolist() == [0]


@given(count=st.integers(0, 40), kept=st.integers(1, 12))
def test_the_newest_ticks_are_kept_in_order(tmp_path_factory, count, kept):
    file = tmp_path_factory.mktemp("times") / "times.npz"
    times = TickTimes(file, kept)
    for stamp in range(count):
        times.tick(stamp)
    times.close()
    assert read_tick_times(file)["stamp"].tolist() == list(range(count))[-kept:]


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 10**6)), max_size=30))
def test_every_moment_belongs_to_one_part(tmp_path_factory, laps):
    file = tmp_path_factory.mktemp("times") / "times.npz"
    clock = Clock()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "time", clock)
        times = TickTimes(file, 4)
        times.woken()
        for part, duration in laps:
            clock.after(duration)
            times.lap(part)
        times.tick(1)
        times.close()
    found = read_tick_times(file)
    spent = sum(found[part][0] for part in PARTS)
    assert spent == found["done"][0] - found["woken"][0] == sum(d for _, d in laps)


def test_nodes_of_one_process_count_no_moment_twice(tmp_path, clock):
    first, second = (TickTimes(tmp_path / f"{k}.npz", 4) for k in range(2))
    first.woken()
    second.woken()
    clock.after(100)
    first.lap(STAGE)
    clock.after(10)
    second.lap(STAGE)
    first.tick(1)
    second.tick(1)
    for one in (first, second):
        one.close()
    stages = [read_tick_times(tmp_path / f"{k}.npz")["stage"].tolist() for k in range(2)]
    assert stages == [[100], [10]]


def test_an_interrupted_end_leaves_no_half_file(tmp_path, monkeypatch):
    def interrupted(file, **arrays):
        file.write(b"PK")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    with pytest.raises(KeyboardInterrupt):
        TickTimes(tmp_path / "times.npz", 4).close()
    assert not list(tmp_path.iterdir())


def test_without_a_file_nothing_is_measured():
    times = tick_times(TickTimesParameters())
    assert type(times) is NoTickTimes
    publisher = Publisher(Clock(), 0)
    times.watch(publisher, topics.STATE)
    assert "publish" not in vars(publisher)


def test_the_table_is_allocated_before_the_flight(tmp_path):
    times = TickTimes(tmp_path / "times.npz", 100)
    assert np.all(times._rows == 1)


def test_the_result_of_a_process_ends_the_parts_of_all_its_nodes(tmp_path, clock):
    process, node = (TickTimes(tmp_path / f"{name}.npz", 4) for name in ("process", "node"))
    send = process.measured(lambda: clock.after(60))
    for one in (process, node):
        one.woken()
    clock.after(20)
    process.lap(TAKE)
    clock.after(300)
    node.lap(STAGE)
    clock.after(5)
    send()
    clock.after(40)
    node.lap(STAGE)
    node.tick(1)
    process.tick(1)
    for one in (process, node):
        one.close()
    process, node = (read_tick_times(tmp_path / f"{name}.npz") for name in ("process", "node"))
    assert process["sending"] - process["woken"] == 325
    assert process["sent"] - process["sending"] == 60
    assert process["take until sending"] == 20 and process["encode until sending"] == 5
    assert node["stage until sending"] == 300 and node["stage"] == 340
