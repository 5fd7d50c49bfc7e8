"""The node teleop over ROS: twist while the dead-man button is held, gripper, hold."""

import time

from geometry_msgs.msg import TwistStamped
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Joy
from std_srvs.srv import Trigger

from uam_msgs_py.messages import topics


def joy(axis=0.0, *pressed):
    message = Joy(axes=[0.0] * 8, buttons=[int(number in pressed) for number in range(8)])
    message.axes[1] = axis
    return message


def test_a_gamepad_moves_the_hand_by_the_missions_limits_and_silence_stops_it(start, probe):
    held = []

    def hold(_, response):
        held.append(True)
        response.success, response.message = True, "hold"
        return response

    def limits(request, response):
        assert list(request.names) == ["jog_speed", "jog_turn_rate"]
        response.values = [ParameterValue(type=3, double_value=one) for one in (0.0175, 0.06)]
        return response

    probe.node.create_service(Trigger, "mission/hold", hold)
    probe.node.create_service(GetParameters, "mission/get_parameters", limits)
    start("uam_control.nodes.teleop")
    pad = probe.publisher(topics.JOY)
    twists, gripper = (
        probe.collect(topic) for topic in (topics.END_EFFECTOR_TWIST, topics.GRIPPER_COMMAND)
    )
    probe.until(lambda: pad.get_subscription_count(), "a subscription")
    probe.until(lambda: probe.has_writers(topics.GRIPPER_COMMAND), "a writer")

    def send(message, done, what):
        end = time.monotonic() + 20.0
        while not done():
            assert time.monotonic() < end, what
            pad.publish(message)
            again = time.monotonic() + 0.03
            probe.until(lambda: done() or time.monotonic() > again, what)  # noqa: B023

    def newest():
        return deserialize_message(twists[-1], TwistStamped)

    send(joy(1.0, 4), lambda: len(twists) > 3, "twists")
    assert newest().header.frame_id == "world"
    assert (newest().twist.linear.x, newest().twist.linear.y) == (0.0175, 0.0)
    probe.until(lambda: newest().twist.linear.x == 0.0, "a twist of zeros after the last joy")
    count = len(twists)
    for _ in range(3):
        pad.publish(joy(1.0))  # without the dead-man button
    send(joy(0.0, 0, 4), lambda: gripper, "a command of the gripper")
    assert gripper[-1].data == 1.0 and len(twists) == count
    send(joy(0.0, 1), lambda: held, "a hold")
