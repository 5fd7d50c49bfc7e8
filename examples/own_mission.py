"""Example of a user's own mission: up, hover, down. It owns reference, magnet and arming.

    uam fly --scenario hover --without mission         prints the ROS domain, for instance 1
    ROS_DOMAIN_ID=1 python examples/own_mission.py     in another terminal

There is no supervisor in such a flight: limits, holds and the operator's commands are its own work.
"""

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

UP, DOWN, LENGTH, HEIGHT = 1.0, 5.0, 3.0, 0.6  # [s] starts of both moves, their length, [m]
LANDED, DONE, SINK = 8.5, 10.0, 0.02  # [s] [s], [m] that the reference ends below the ground


def move(time):
    """Return value, rate and acceleration of a quintic from 0 to 1 in LENGTH [s]."""
    u = min(max(time / LENGTH, 0.0), 1.0)
    rate, bend = 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
    return u**3 * (10 + u * (6 * u - 15)), rate / LENGTH, bend / LENGTH**2


class OwnMission(Node):
    """Answers each state with a reference of its stamp and the magnet; reports its status."""

    def __init__(self):
        super().__init__("mission")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.armed, self.start, self.begun, self.last = False, None, 0.0, ""
        self.reference = self.create_publisher(JointTrajectory, "uam/reference", 10)
        self.magnet = self.create_publisher(Bool, "uam/magnet", 10)
        self.arming = self.create_publisher(Bool, "uam/arming", latched)
        self.status = self.create_publisher(DiagnosticArray, "uam/mission/status", latched)
        self.create_subscription(JointTrajectory, "uam/state", self.on_state, 10)
        state = "uam/autopilot/state"
        self.create_subscription(DiagnosticArray, state, self.on_autopilot, latched)

    def on_autopilot(self, message):
        self.armed = any(v.key == "armed" and v.value == "True" for v in message.status[0].values)

    def on_state(self, message):
        now = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        names, chi = list(message.joint_names), list(message.points[0].positions)
        if self.start is None and self.armed:  # here begins the flight, and its mission time
            self.start, self.begun = chi, now
        time = -1.0 if self.start is None else now - self.begun
        flying = 0.0 <= time < LANDED
        rows = [[0.0] * len(names) for _ in range(3)]
        rows[0] = [0.0] * 6 + [0.0, 1.5708]  # the arm as in the scenario
        if flying:
            rows[0][:3], rows[0][5] = self.start[:3], self.start[5]
            for row, up, down in zip(rows, move(time - UP), move(time - DOWN), strict=True):
                row[2] += HEIGHT * up - (HEIGHT + SINK) * down
        first = 0 if flying else 6  # on the ground only the arm is controlled
        point = JointTrajectoryPoint(positions=rows[0][first:], velocities=rows[1][first:])
        point.accelerations = rows[2][first:]
        self.report(message.header, time)  # before the magnet, which completes the tick
        self.reference.publish(
            JointTrajectory(header=message.header, joint_names=names[first:], points=[point])
        )
        self.magnet.publish(Bool(data=False))

    def report(self, header, time):
        phase = "waiting" if time < 0.0 else "landed" if time >= LANDED else "hover"
        what = f"{phase} {time >= DONE} {time // 0.5}"
        if what == self.last:
            return
        self.last = what
        self.arming.publish(Bool(data=phase != "landed"))
        values = {"phase": phase, "time": time, "done": time >= DONE, "abort_reason": ""}
        values |= {"position_error": 0.0, "attitude_error": 0.0, "arm_error": 0.0, "magnet": False}
        pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        status = DiagnosticStatus(name="mission", message=phase, values=pairs)
        self.status.publish(DiagnosticArray(header=header, status=[status]))


if __name__ == "__main__":
    rclpy.init()
    try:
        rclpy.spin(OwnMission())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
