"""Which poses of the motion capture the autopilot gets."""

import numpy as np
import pytest

from uam_control.stages.vision_pacing import BEYOND, VisionPacing, VisionParameters, beyond

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class Port:
    """An autopilot that keeps the x of the poses that it gets."""

    def __init__(self):
        self.found = []

    def send_vision(self, pose):
        self.found.append(pose.position[0])


def moving(speed: float) -> np.ndarray:
    """Estimate (3, 8) at the origin, `speed` [m/s] along x."""
    state = np.zeros((3, 8))
    state[1, 0] = speed
    return state


@pytest.mark.parametrize(
    ("position", "speed", "age", "off"),
    [((0.3, 0.4, 0.0), 0.0, 0.1, 0.5), ((-2.0, 0.0, 0.0), 10.0, 0.2, 0.0)],
)
def test_how_far_a_pose_is_off_beyond_the_way_since(position, speed, age, off):
    assert beyond(np.array(position), moving(speed), age) == pytest.approx(off)


@pytest.mark.parametrize(("state", "sent"), [(moving(0.0), [0.0, 0.1]), (None, [0.0, 0.7, 0.1])])
def test_a_pose_that_the_estimate_contradicts_is_not_sent(state, sent):
    pacing, port = VisionPacing(VisionParameters()), Port()
    for k, x in enumerate((0.0, BEYOND + 0.2, 0.1)):
        pacing.take(0.02 * k, np.array([x, 0.0, 0.0]), LEVEL, True)
        pacing.send(port, 0.02 * k, state)
    assert port.found == sent


def test_after_a_pose_that_is_off_only_a_close_one_is_sent_for_half_a_second():
    pacing, port = VisionPacing(VisionParameters()), Port()
    for now, x in ((0.0, 0.7), (0.4, 0.3), (0.8, 0.31), (0.82, 0.1), (1.32, 0.32)):
        pacing.take(now, np.array([x, 0.0, 0.0]), LEVEL, True)
        pacing.send(port, now, moving(0.0))
    assert port.found == [0.1, 0.32]
