"""A vehicle that follows the mission's reference, for tests of the mission node over ROS."""

import numpy as np
from std_srvs.srv import SetBool, Trigger

from uam_control.coordinates import coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_reference
from uam_msgs_py.messages.convert import JointStateWriter, PoseWriter, TrajectoryWriter
from uam_msgs_py.messages.status import AutopilotState, MissionStatus

COORDINATES = coordinates(2)

PERIOD = 4_000_000  # [ns]


class Vehicle:
    """A vehicle that follows its reference exactly, one tick later."""

    def __init__(self, probe):
        self.probe, self.stamp = probe, 0
        self.states = probe.publisher(topics.STATE)
        self.autopilot = probe.publisher(topics.AUTOPILOT_STATE)
        self.battery = probe.publisher(topics.AUTOPILOT_BATTERY)
        self.poses = probe.publisher(topics.MOCAP)
        self.joints = probe.publisher(topics.JOINTS)
        gains = (topics.POSITION_ADAPTATION, topics.ATTITUDE_ADAPTATION, topics.ARM_ADAPTATION)
        self.gains = [probe.publisher(topic) for topic in gains]
        self.pose, self.angles = PoseWriter(), JointStateWriter(["alpha_1", "alpha_2"])
        self.adapted = JointStateWriter(["K0"])
        self.references = probe.collect(topics.REFERENCE)
        self.magnet = probe.collect(topics.MAGNET)
        self.reported = probe.collect(topics.MISSION_STATUS)
        self.writer = TrajectoryWriter(COORDINATES)
        self.state = np.zeros((3, 8))
        self.state[0, 2], self.state[0, 7] = 0.28, np.pi / 2
        probe.until_connected(
            "mission",
            [self.states, self.autopilot, self.battery, self.poses, self.joints, *self.gains],
            [topics.REFERENCE, topics.MAGNET, topics.MISSION_STATUS],
        )

        self.armed, self.wobble = False, 1e-4

    def arm(self):
        self.armed = True
        self.tell()

    def tell(self):
        state = AutopilotState(True, "OFFBOARD", self.armed, 1 if self.armed else None)
        self.autopilot.publish(state.to_message(self.stamp))

    def sense(self):
        """Publish what the pre-arm report requires: pose, joint angles, adapted gains."""
        self.wobble = -self.wobble  # equal poses come from a frozen tracker
        position = self.state[0, :3] + self.wobble
        self.poses.publish(self.pose.fill(self.stamp, position, np.array([1.0, 0.0, 0.0, 0.0])))
        self.joints.publish(self.angles.stamped(self.stamp))
        for topic in self.gains:
            topic.publish(self.adapted.stamped(self.stamp))

    def fly(self, ticks):
        for _ in range(ticks):
            self.stamp += PERIOD
            if self.stamp % (50 * PERIOD) == 0:
                self.tell()
            if self.stamp % (5 * PERIOD) == 0:
                self.sense()
            before = len(self.magnet)
            self.states.publish(self.writer.fill(self.stamp, self.state))
            self.probe.until(lambda n=before: len(self.magnet) > n, "an answered tick")
            _, reference = read_reference(self.references[-1])
            if reference.flying:
                self.state[:2] = reference.values[:2]
                self.state[0, 2] = max(self.state[0, 2], 0.28)

    def until_state(self, state):
        for _ in range(3000):
            self.fly(1)
            if self.status.state == state:
                return
        raise AssertionError(f"still {self.status}")

    def until(self, reached):
        """Wait until `reached(status)`: the status of a tick may come after its magnet."""
        self.probe.until(lambda: reached(self.status), "a status")

    @property
    def status(self) -> MissionStatus:
        self.probe.until(lambda: self.reported, "the first status")
        return MissionStatus.from_message(self.reported[-1])[1]

    def ask(self, name, on=None):
        kind = Trigger if on is None else SetBool
        request = Trigger.Request() if on is None else SetBool.Request(data=on)
        answer = self.probe.call(kind, f"/mission/{name}", request)
        return answer.success, answer.message


def take_off(vehicle):
    vehicle.fly(60)  # the autopilot reports once in 50 ticks
    accepted, text = vehicle.ask("start")
    assert accepted, text
    vehicle.arm()
    vehicle.until_state("taking off")
    assert vehicle.ask("hold") == (False, "refused: not while taking off")
    vehicle.until_state("flying")
