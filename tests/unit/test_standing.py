"""A vehicle that somebody else lands stands when it has sunk, and sinks no more."""

from uam_control.mission.ground import Standing


def test_it_stands_once_it_has_sunk_and_stopped():
    standing = Standing()
    changes = [standing.update(rate) for rate in (0.0, -0.1, -0.7, -0.1, -0.04, 0.0, 0.3)]
    assert changes == [False, False, False, False, True, False, False]
    assert standing.value


def test_hovering_or_climbing_is_not_standing():
    standing = Standing()
    assert not any(standing.update(rate) for rate in (0.0, 1.0, -0.15, 0.0))
    assert not standing.value


def test_it_does_not_stand_when_it_sinks_again():
    standing = Standing()
    changes = [standing.update(rate) for rate in (-0.5, 0.0, -0.1, -0.3, -0.1, 0.0)]
    assert changes == [False, True, False, True, False, True]
