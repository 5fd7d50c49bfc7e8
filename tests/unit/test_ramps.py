"""Ramps of races that begin and end at speed: within the limits of the vehicle and the room."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.mission import Feasibility, load_scenario
from uam_control.mission.feasibility import in_words
from uam_control.mission.scenarios.ramps import within_room
from uam_control.profiles.profile import load_profile

PROFILE = load_profile("s500", "race_10")
SMALL = load_profile("s500").sets["mission"]  # 5 m to all sides
LARGE = PROFILE.sets["mission"]  # 20 m


def race(folder, row, length):
    """A file with positions every 10 ms: row(t) → x, y, z."""
    file = folder / "race.csv"
    times = np.arange(0.0, length, 0.01)
    lines = [",".join(f"{v:.6f}" for v in (t, *row(t))) for t in times]
    file.write_text("\n".join(["t,px,py,pz", *lines]) + "\n")
    return load_scenario(str(file))


def circle(radius, speed, height, climb=0.0, centre=0.0):
    """Row of a circle; climb [m/s] at its begin."""
    w = speed / radius
    return lambda t: (
        radius * np.cos(w * t), centre + radius * np.sin(w * t), height + climb / w * np.sin(w * t)
    )  # fmt: skip


RACES = {
    "5 m/s, straight, 3 m from the fence": (SMALL, lambda t: (-2 + 5 * t, 0.0, 1.5), 0.8),
    "5 m/s, begins upward at 2 m/s": (SMALL, circle(4.0, 5.0, 2.0, climb=2.0), 3.3),
    "5 m/s, upward at 2 m/s from 1.5 m": (SMALL, circle(4.0, 5.0, 1.5, climb=2.0), 2.4),
    "slalom": (
        SMALL,
        lambda t: (-4 + 2 * t, np.sin(2.5 * t + 0.7), 1.5 + 0.3 * np.sin(2 * t)),
        4.0,
    ),
    "10 m/s, straight": (LARGE, lambda t: (-10 + 10 * t, 10.0, 3.0), 2.0),
    "10 m/s, ends downward at 2 m/s": (LARGE, circle(12.0, 10.0, 2.0, 2.0, centre=10.0), 3.0),
}


@pytest.mark.parametrize("name", RACES)
def test_a_race_flies_at_full_speed_with_ramps_that_fit(tmp_path, name):
    limits, row, length = RACES[name]
    check = Feasibility(PROFILE.vehicle, replace(limits, retime_reserve=0.0), 0.0)
    written = race(tmp_path, row, length)
    flown, factor = check.retimed(written)
    assert factor == 1.0 and not check.excesses(flown)
    assert flown.route.trajectory is written.route.trajectory
    path = flown.route.path
    for joint in np.cumsum([leg.path.length for leg in flown.route.legs])[:-1]:
        before, after = (path.rows(np.array([joint + d]))[:, 0] for d in (-1e-7, 1e-7))
        np.testing.assert_allclose(before, after, atol=1e-2)
    ends = path.rows(np.array([1e-9, path.length - 1e-9]))[1:]
    np.testing.assert_allclose(ends, 0.0, atol=1e-3)


def test_a_race_without_room_is_refused_with_both_ramps_and_slowed_down_until_they_fit(tmp_path):
    """5 m/s in 1.5 m need 8.3 m/s^2 on average, and the vehicle must turn to it before."""
    check = Feasibility(PROFILE.vehicle, SMALL, 0.0)
    scenario = race(tmp_path, lambda t: (-3.5 + 5 * t, 0.0, 1.5), 1.4)
    words = in_words(check.excesses(check.fitted(scenario)))
    assert "run-up: x -12.7 m is below -5 m" in words
    assert "run-out: x 12.7 m exceeds 5 m" in words
    slower, factor = check.retimed(scenario)
    assert 1.0 < factor < 2.0 and not check.excesses(slower)
    assert slower.route.trajectory.length == pytest.approx(1.39 * factor)


@settings(max_examples=20, deadline=None)
@given(
    velocity=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    acceleration=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    room=st.floats(0.5, 3.0),
)
def test_a_run_up_stays_in_its_room_and_ends_as_the_trajectory_begins(velocity, acceleration, room):
    goal = np.zeros((5, 8))
    goal[1, :3], goal[2, :3] = velocity, acceleration
    low, high = np.full(3, -room), np.full(3, room)
    found = list(within_room(goal, low, high))
    assert found
    for ramp in found[:: max(1, len(found) // 10)]:
        rows = ramp.rows(np.linspace(0.0, ramp.length, 200))
        assert np.abs(rows[0, :, :3]).max() < room * 1.02 + 0.02
        np.testing.assert_allclose(ramp.ends()[0][1:], 0.0, atol=1e-9)
        np.testing.assert_allclose(ramp.ends()[1], goal, atol=2e-5)
