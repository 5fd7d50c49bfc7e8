"""The effects of a laboratory on motion capture and messages: each by hand."""

import math

import numpy as np
import pytest
from effects_rig import flown, plant

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.mavlink.transport.faulty_transport import FaultyTransport
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.arm_occlusion import distance, hide, seen_markers, shift_pose
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay
from uam_sim_bridge.plant.effects.pose_effects import drop, express, jitter, jump

LEVEL = np.eye(3).ravel()
SENSING = ("propeller_vibration", "mocap_jitter", "mocap_dropouts", "arm_occlusion")
MOCAP = ("mocap_jitter", "mocap_dropouts", "arm_occlusion")


# Mocap


@pytest.mark.parametrize(
    ("ends", "gap"),
    [
        (([0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]), 1.0),  # parallel
        (([0, 0, 0], [1, 0, 0], [0.5, -1, 0.3], [0.5, 1, 0.3]), 0.3),  # crossing above
        (([0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]), 1.0),  # in line
        (([0, 0, 0], [0, 0, 0], [0, 3, 4], [0, 3, 8]), 5.0),  # a point
    ],
)
def test_distance_of_segments(ends, gap):
    assert distance(*(np.array(end, dtype=float) for end in ends)) == pytest.approx(gap)


def test_a_link_in_the_line_of_sight_hides_a_marker():
    base, marker = np.array([0.0, 0.0, 1.0]), np.zeros((1, 3))
    cameras = np.array([[4.0, 0, 1.0], [-4.0, 0, 1.0]])
    seen = np.zeros(1, dtype=np.bool_)
    away = np.array([[0.2, 0, 0.5], [0.2, 0, 0.8]])
    across = np.array([[0.2, 0, 0.5], [0.2, 0, 1.2]])
    assert seen_markers(base, LEVEL, marker, cameras, away, 0.03, seen) == 1
    assert seen_markers(base, LEVEL, marker, cameras, across, 0.03, seen) == 0 and not seen[0]


def test_hidden_markers_shift_the_pose_by_their_errors():
    # two markers on the x axis are seen; errors: both 1 mm up, the outer one 2 mm to the left
    markers = np.array([[0.1, 0, 0], [-0.1, 0, 0], [0, 0.3, 0]])
    errors = np.array([[0, 0.002, 0.001], [0, 0, 0.001], [9, 9, 9]])
    pose = np.array([0.0, 1, 2, 3, 1, 0, 0, 0])
    shift_pose(pose, LEVEL, markers, errors, np.array([True, True, False]))
    assert pose[1:4] == pytest.approx([1.0, 2.001, 3.001])
    assert pose[4:] == pytest.approx([1.0, 0, 0, 0.01 / 2], abs=2e-5)  # 2 mm over 0.2 m about z


def test_a_thick_arm_hides_the_vehicle():
    one = plant("arm_occlusion")
    arrays, bench = one.effects.acting["arm_occlusion"].arrays, one.effects.bench
    for thickness in (0.0, 5.0):
        bench.pose[:], bench.lost = 0.5, False
        hide(arrays._replace(thickness=thickness))
        assert bench.lost == (thickness == 5.0) and np.all(bench.pose == 0.5)


def test_stamps_jitter_but_never_go_back_and_the_position_wanders():
    one = plant("mocap_jitter:stamp=0.01,wander=0.001,wander_time=0.01")
    poses = []
    for k in range(2000):
        one.effects.draw()
        one.effects.bench.pose[0:4] = k / 120.0, 0.0, 0.0, 0.0
        jitter(one.effects.acting["mocap_jitter"].arrays)
        poses.append(one.effects.bench.pose[0:4].copy())
    assert np.all(np.diff(np.array(poses)[:, 0]) > 0.0)
    assert np.std(np.array(poses)[:, 1:]) == pytest.approx(0.001, rel=0.1)


def test_dropouts_lose_their_share_and_bursts():
    def lost(spec):
        one, found = plant(f"mocap_dropouts:{spec}"), []
        for k in range(12000):
            one.effects.draw()
            one.effects.bench.lost = False
            one.effects.bench.pose[0] = k / 120.0
            drop(one.effects.acting["mocap_dropouts"].arrays)
            found.append("x" if one.effects.bench.lost else ".")
        return "".join(found)

    assert lost("share=0.1,bursts=0").count("x") / 12000 == pytest.approx(0.1, abs=0.01)
    bursts = lost("share=0,bursts=1,burst_time=0.05,longest=0.2")
    longest = max(map(len, bursts.split(".")))
    assert 6 <= longest <= 1 + 0.2 * 120 and 0.02 < bursts.count("x") / 12000 < 0.1


@pytest.mark.parametrize("rate", [30.0, 60.0, 360.0])
def test_the_motion_capture_has_another_rate_and_delay(rate):
    feed = f"mocap_feed:rate={rate},position_noise=0,attitude_noise=0,latency=0.02"
    one, found, places = plant(feed), [], []
    for k in range(250):
        found += [(k, pose) for pose in one.sense().poses]
        places.append(one.truth().state[0, :3])
        one.step(np.full(4, 0.7), np.zeros(2), False)
    stamps = np.array([pose[0] for _, pose in found])
    assert len(stamps) == pytest.approx(rate * 0.98, abs=2)  # several in a tick
    apart = 4e-3 if rate < 250.0 else 1e-6  # of the ticks, or of its own time
    assert np.diff(stamps) == pytest.approx(1.0 / rate, abs=apart)
    for k, (stamp, place, _) in found:
        assert 0.02 - 1e-9 <= 0.004 * k - stamp < 0.024
        path = [np.interp(stamp, 0.004 * np.arange(250), axis) for axis in np.array(places).T]
        assert place == pytest.approx(path, abs=5e-5)  # of its own time, also between two ticks


def test_the_frame_of_an_odometry_by_hand():
    """A quarter turn and a shift; a jump of 0.5 m along y; one that would lead on goes back."""
    frame = np.array([1.0, 2.0, 3.0, math.pi / 2.0])
    position, quaternion = np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0])
    express(frame, position, quaternion)
    assert position == pytest.approx([1.0, 3.0, 3.5])
    assert quaternion == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    frame = np.zeros(4)
    jump(frame, np.array([0.0, 7.0, 0.0, 1.0]), 0.5, 0.1)
    assert frame == pytest.approx([0.0, 0.5, 0.0, -0.1])
    jump(frame, np.array([0.0, 1.0, 0.0, 1.0]), 0.4, 0.1)
    assert frame == pytest.approx([0.0, 0.1, 0.0, 0.0])


def test_an_odometry_drifts_and_jumps_as_often_as_said():
    one = plant("odometry_drift:walk=0,turn=0,jumps=0.9,jump=0.3,jump_turn=0")
    acting, drift = one.effects.acting["odometry_drift"], []
    for _ in range(2400):  # 20 s at 120 Hz
        one.effects.draw()
        acting.steps["pose"](acting.arrays)
        drift.append(acting.arrays[4][:3].copy())
    ways = np.linalg.norm(np.diff(drift, axis=0), axis=1)
    assert 8 <= np.count_nonzero(ways) <= 30 and ways[ways > 0.0] == pytest.approx(0.3)
    one = plant("odometry_drift:walk=0.1,turn=0,jumps=0,jump=0,jump_turn=0")
    acting, drift = one.effects.acting["odometry_drift"], []
    for _ in range(12000):
        one.effects.draw()
        acting.steps["pose"](acting.arrays)
        drift.append(acting.arrays[4][:3].copy())
    seconds = np.diff(drift[::120], axis=0)
    assert np.std(seconds) == pytest.approx(0.1, rel=0.2)


# Network


class Wire:
    """A transport that notes what it sends."""

    stream, bytes_per_second, connected, dropped = False, None, True, 0

    def __init__(self):
        self.sent = []

    def send(self, data):
        self.sent.append(data)
        return True


def test_messages_arrive_after_the_delay_and_in_order():
    wire = Wire()
    late = FaultyTransport(wire, Schedule(), SetpointDelay(0.006, 0.0, 0.0, 1))
    for tick in range(5):
        late.update(0.004 * tick)
        assert late.send(bytes([tick]))
        assert wire.sent == [bytes([k]) for k in range(max(0, tick - 1))]  # 6 ms: two ticks later


def test_a_message_without_delay_is_sent_at_once_unless_another_waits():
    wire = Wire()
    late = FaultyTransport(wire, Schedule(), SetpointDelay(0.0, 0.0, 0.0, 1))
    late.update(0.0)
    late.send(b"a")
    assert wire.sent == [b"a"]


def test_delays_have_the_stated_quantiles_and_are_those_of_the_seed():
    made = presets.read((), ["network_delay"])
    delay = SetpointDelay.of(made, 5)
    again = SetpointDelay.from_text(delay.to_text())
    late = np.array([delay.at(0.004 * tick) for tick in range(20000)])
    assert delay.at(0.0) == late[-1]  # further messages of a tick, and older ticks
    assert np.array_equal(late, [again.at(0.004 * tick) for tick in range(20000)])
    assert np.quantile(late, 0.5) == pytest.approx(0.004, abs=2e-4)
    assert np.quantile(late, 0.99) == pytest.approx(0.012, abs=6e-4)
    assert SetpointDelay.of({}, 5) is None and SetpointDelay.from_text("") is None
    with pytest.raises(ValueError, match="is not valid"):
        SetpointDelay.from_text("late")


def test_poses_arrive_later_with_the_stamp_of_their_exposure():
    def ages(*specs):
        samples, _ = flown(plant(*specs), 200, 0.0)
        return [0.004 * k - s.mocap[0] for k, s in enumerate(samples) if s.mocap is not None]

    assert set(np.round(ages(), 9)) == {0.012}
    late = ages("network_delay:mocap=0.02,mocap_jitter=0")
    assert set(np.round(late, 9)) == {0.032}
