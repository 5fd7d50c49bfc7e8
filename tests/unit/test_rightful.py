"""Who may publish a topic of the control loop, and which stamps and messages are refused."""

import pytest

pytest.importorskip("rclpy")

from uam_control.settings.parameter_set import ParameterError
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.node import wiring
from uam_msgs_py.node.door import Refusals
from uam_msgs_py.node.health import LASTING, StampWatch
from uam_msgs_py.node.rightful import PUBLISHERS, Rightful, RightfulNodes

PERIOD = 4_000_000


def test_by_default_each_node_of_the_stack_is_the_only_publisher_of_its_topics():
    nodes = RightfulNodes("/uav1")
    for topic, publisher in PUBLISHERS.items():
        sensor = publisher == wiring.PLANT
        assert nodes.of(topic) == Rightful(f"/uav1/{publisher}", only=not sensor)


def test_each_topic_of_one_publisher_that_nodes_act_on_has_a_rightful_one():
    assert {one.name for one in topics.RECORDED if one.one_publisher} <= set(PUBLISHERS)
    assert RightfulNodes("/").of(topics.RESTARTS.name) == Rightful("/uam_fly", True)


@pytest.mark.parametrize(
    "given, topic, expected",
    [
        ("mission=my_planner", "uam/reference", Rightful("/my_planner", True)),
        ("mission=my_planner", "uam/arming", Rightful("/my_planner", True)),
        ("mission=my_planner", "uam/state", Rightful("/state_estimator", True)),
        ("/uam/reference = /lab/planner", "uam/reference", Rightful("/lab/planner", True)),
        ("mission=a,uam/magnet=b", "uam/magnet", Rightful("/b", True)),
        ("imu/data=imu_driver", "imu/data", Rightful("/imu_driver", True)),
        ("mujoco_sim=mujoco_sim", "clock", Rightful("/mujoco_sim", True)),
        ("arm_controller=any", "uam/arm/command", Rightful("/arm_controller", False)),
        ("any, mission=mission", "uam/state", Rightful("/state_estimator", False)),
        ("any, mission=mission", "uam/reference", Rightful("/mission", True)),
    ],
)
def test_the_parameter_names_others(given, topic, expected):
    assert RightfulNodes("/", given).of(topic) == expected


@pytest.mark.parametrize(
    "given, complaint",
    [
        ("misson=a", "'misson' is none of the nodes mujoco_sim, .*and topics clock, imu/data, "),
        ("mission", "'mission'; allowed: NODE=NAME or TOPIC=NAME"),
        ("mission=my planner", "'mission=my planner'; allowed"),
        ("mission=", "'mission='; allowed"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(given, complaint):
    with pytest.raises(ParameterError, match=complaint) as refused:
        RightfulNodes("/", given)
    assert "\n" not in str(refused.value)


def watch(*topics):
    made = StampWatch()
    for topic in topics:
        made.listen(topic)
    return made


def test_the_clock_is_that_of_the_ticks():
    assert watch("vrpn_mocap/uam/pose", "uam/state").clock == "uam/state"
    assert watch("joint_states", "imu/data", "uam/state").clock == "imu/data"
    assert watch("joint_states").clock == ""


def ticks(one, offset, count, first=100):
    """Ticks with a message of the clock and a pose `offset` [ns] beside it; which are refused."""
    refused = []
    for k in range(first, first + count):
        one.check("imu/data", k * PERIOD, "/imu")
        try:
            one.check("mocap", k * PERIOD + offset, "/imu")
        except BadMessage as error:
            refused.append((k - first, str(error)))
    return refused


@pytest.mark.parametrize("offset", [1_700_000_000 * SECOND, -SECOND - 1, SECOND + 1])
def test_a_lasting_difference_of_the_stamps_is_refused_until_it_ends(offset):
    one = watch("imu/data")
    refused = ticks(one, offset, LASTING + 5)
    assert [k for k, _ in refused] == list(range(LASTING, LASTING + 5))
    assert f"stamp {(100 + LASTING) * 0.004 + offset / SECOND:.3f} s" in refused[0][1]
    assert "of imu/data by /imu" in refused[0][1]
    assert ticks(one, 0, 5, first=200) == []


@pytest.mark.parametrize("offset", [0, SECOND, -SECOND])
def test_late_and_early_stamps_are_none_of_another_clock(offset):
    assert ticks(watch("imu/data"), offset, 100) == []


def test_while_the_clock_is_silent_nothing_becomes_foreign():
    one = watch("imu/data")
    one.check("imu/data", 0, "/imu")
    for k in range(1000):  # the IMU has failed; a node that was stalled reads its queue
        one.check("mocap", k * PERIOD, "/imu")
    assert ticks(one, 0, 5, first=1001) == []


def test_a_new_simulation_is_no_other_clock():
    one = watch("imu/data")
    assert ticks(one, 0, 50, first=5000) == []
    one.check("mocap", PERIOD, "/imu")  # the pose of a tick comes before its IMU sample
    assert ticks(one, 0, 50, first=1) == []


def test_refused_messages_are_counted_by_topic_and_sender():
    refusals = Refusals()
    for reason in ("positions of x is nan", "no points"):
        refusals.note("/uam/state", "/a", "/a", reason)
    refusals.note("/uam/state", "/b", "/a", "no points")
    assert refusals.count == 3
    assert refusals.texts() == [
        "/uam/state: refused /a (2 messages): no points; publisher is /a",
        "/uam/state: refused /b (1 messages): no points; publisher is /a",
    ]
