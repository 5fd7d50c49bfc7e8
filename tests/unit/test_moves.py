"""Moves of single coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.mission.motion.trajectory import Move, Moves, empty_motion

START = np.array([0.0, 0.0, 0.28, 0.0, 0.0, 0.0, 0.0, np.pi / 2])


def value(moves, time):
    motion = empty_motion(2)
    moves.write(time, motion)
    return motion


@given(st.floats(0.5, 30), st.floats(-2, 2))
def test_a_move_starts_and_ends_at_rest(length, to):
    moves = Moves(START, [Move("x", 1.0, 1.0 + length, to)])
    for time, expected in ((0.5, 0.0), (1.0, 0.0), (1.0 + length, to), (2.0 + length, to)):
        reference = value(moves, time)
        assert reference[0, 0] == pytest.approx(expected, abs=1e-12)
        np.testing.assert_allclose(reference[1:4], 0.0, atol=1e-9)
    assert value(moves, 1.0 + length / 2)[0, 0] == pytest.approx(to / 2)


MOVE = st.tuples(
    st.sampled_from(["x", "z", "yaw", "alpha_2"]),
    st.floats(0.5, 4.0),  # [s] length
    st.floats(0.0, 3.0),  # [s] pause before it
    st.floats(-2.0, 2.0),  # where it ends
)


@given(st.lists(MOVE, max_size=12), st.lists(st.floats(0.0, 40.0), min_size=1, max_size=8))
def test_each_coordinate_follows_its_newest_move(drawn, times):
    free, moves = {}, []
    for coordinate, length, pause, to in drawn:
        begin = free.get(coordinate, 0.0) + pause
        free[coordinate] = begin + length
        moves.append(Move(coordinate, begin, begin + length, to))
    together = Moves(START, moves)
    table = together.rows(np.array(times))
    for i, time in enumerate(times):
        motion = value(together, time)
        np.testing.assert_array_equal(table[:, i], motion)
        for place, name in enumerate(("x", "y", "z", "roll", "pitch", "yaw", "alpha_1", "alpha_2")):
            before, alone = START.copy(), None
            for move in (one for one in moves if one.coordinate == name and one.start <= time):
                if alone is not None:
                    before[place] = alone.to
                alone = move
            expected = value(Moves(before, [alone] if alone else []), time)
            np.testing.assert_array_equal(motion[:, place], expected[:, place])
