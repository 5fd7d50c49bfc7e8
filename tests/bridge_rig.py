"""A test rig around the bridge node: plant, estimator, controllers, and the autopilot's objects."""

import socket

import numpy as np
from free_port import free_port
from geometry_msgs.msg import TwistStamped
from quadrotor import MASS, Quadrotor
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool

from uam_control.frames import swap_body
from uam_control.maths.rotations import euler_from_quaternion
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import ATTITUDE_NAMES, PositionCommandWriter, TorqueWriter
from uam_msgs_py.messages.convert import PoseWriter, TrajectoryWriter
from uam_msgs_py.messages.ros_time import nanoseconds
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer

MODULE = "uam_sim_bridge.nodes.mavlink_bridge"
PERIOD = 4_000_000
NAMES = ["x", "y", "z", "roll", "pitch", "yaw", "alpha_1", "alpha_2"]
WEIGHT = MASS * 9.81


def read_setpoint(data: bytes) -> tuple[int, np.ndarray, float]:
    """The acknowledged setpoint: stamp [ns], body rates (3,) [rad/s, FLU] or NaN, thrust 0..1."""
    message = deserialize_message(data, TwistStamped)
    stamp, rates = message.header.stamp, message.twist.angular
    return nanoseconds(stamp), np.array([rates.x, rates.y, rates.z]), message.twist.linear.z


class Rig:
    """Plant, estimator and controllers as seen by the bridge, tick by tick."""

    def __init__(self, probe, start, *arguments):
        self.local, self.remote = free_port(), free_port()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", self.remote))
        self.socket.setblocking(False)
        self.codec = Codec(1, 1)
        self.framer = Framer(self.codec)
        self.autopilot = Autopilot()
        self.companion = Companion(self.autopilot)
        self.received = []
        self.body = Quadrotor()
        self.probe, self.count = probe, 0
        self.setpoints = probe.collect(topics.SETPOINT)
        self.states = probe.collect(topics.AUTOPILOT_STATE)
        self.out = {
            t.name: probe.publisher(t)
            for t in (
                topics.STATE,
                topics.POSITION_COMMAND,
                topics.ATTITUDE_COMMAND,
                topics.MOCAP,
                topics.ARMING,
            )
        }
        self.node = start(
            MODULE,
            "--ros-args",
            "-p",
            f"local_port:={self.local}",
            "-p",
            f"autopilot_port:={self.remote}",
            *(a.format(local=self.local, remote=self.remote) for a in arguments),
        )
        self.state, self.pose = TrajectoryWriter(NAMES), PoseWriter()
        self.position, self.torque = PositionCommandWriter(), TorqueWriter(ATTITUDE_NAMES)
        received = (topics.SETPOINT, topics.AUTOPILOT_STATE)
        probe.until_connected("mavlink_bridge", self.out.values(), received)

    def publish(self, topic, message):
        self.out[topic.name].publish(message)

    def inputs(self, tau_p=None, tau_q=None):
        """Publish one tick's inputs; without tau_p idle ones."""
        stamp, body = self.count * PERIOD, self.body
        chi = np.zeros((3, 8))
        chi[0, :3], chi[0, 3:6] = body.position, euler_from_quaternion(body.quaternion)
        chi[1, :3], chi[1, 3:6] = body.velocity, body.gyro
        if self.count % 2 == 0:
            seen = body.position + 1e-6 * (self.count % 4)  # equal poses: a frozen tracker
            self.publish(topics.MOCAP, self.pose.fill(stamp, seen, body.quaternion))
        self.publish(topics.STATE, self.state.fill(stamp, chi))
        if tau_p is None:
            self.publish(topics.POSITION_COMMAND, self.position.idle(stamp))
            self.publish(topics.ATTITUDE_COMMAND, self.torque.idle(stamp))
        else:
            self.publish(
                topics.POSITION_COMMAND,
                self.position.fill(stamp, chi, np.zeros((3, 3)), np.array(tau_p, float)),
            )
            self.publish(
                topics.ATTITUDE_COMMAND,
                self.torque.fill(stamp, np.array(tau_q or (0, 0, 0), float)),
            )

    def receive(self):
        """Pass the received messages to the autopilot and return them."""
        arrived = []
        while True:
            try:
                data = self.socket.recv(65535)
            except BlockingIOError:
                break
            arrived += self.framer.datagram(data)
        for message in arrived:
            self.companion.handle(self.body.time, message)
        self.received += arrived
        return arrived

    def tick(self, tau_p=None, tau_q=None):
        """One lockstep tick; return the acknowledged setpoint (rates, thrust)."""
        self.inputs(tau_p, tau_q)
        before, stamp = len(self.setpoints), self.count * PERIOD
        self.probe.until(lambda: len(self.setpoints) > before, "an acknowledged tick")
        found, rates, thrust = read_setpoint(self.setpoints[-1])
        assert found == stamp
        self.autopilot_tick()
        self.count += 1
        return rates, thrust

    def autopilot_tick(self):
        self.receive()
        body = self.body
        motors = self.autopilot.update(body.time, swap_body(body.gyro), swap_body(body.accel))
        for message in self.companion.tick(body.time):
            self.socket.sendto(self.codec.encode(message), ("127.0.0.1", self.local))
        body.step(motors)

    def fly(self):
        """Arm, place the vehicle in the air and let it hover."""
        self.publish(topics.ARMING, Bool(data=True))
        for _ in range(500):
            self.tick()
            if self.autopilot.status.armed:
                break
        assert self.autopilot.status.armed, self.node.output
        self.body.position[2] = 5.0
        self.body.hover()
        for _ in range(100):
            self.tick((0, 0, WEIGHT))

    def kinds(self):
        return {m.get_type() for m in self.received}
