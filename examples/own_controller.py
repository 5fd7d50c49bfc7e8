"""A controller of your own in the place of one of the stack's: here PID for the arm's two joints.

    uam fly --scenario hover --without arm_controller      says which ROS domain it waits in, say 1
    ROS_DOMAIN_ID=1 python examples/own_controller.py      in another terminal

It is called as the node it replaces, listens to /uam/state, and publishes one effort for each
state. /uam/arm/command is for log and report only.
"""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = ["alpha_1", "alpha_2"]
K_P, K_I, K_D = 12.0, 30.0, 0.8  # [N m/rad], [N m/(rad s)], [N m s/rad]
PERIOD, TORQUE_MAX = 0.004, 2.5  # [s], [N m]


class OwnArmController(Node):
    """PID on the joint angles; the integral carries the arm's weight."""

    def __init__(self):
        super().__init__("arm_controller")
        self.reference, self.integral = None, [0.0, 0.0]
        effort = "/arm_effort_controller/commands"
        self.effort = self.create_publisher(Float64MultiArray, effort, 10)
        self.command = self.create_publisher(JointTrajectory, "/uam/arm/command", 10)
        self.create_subscription(JointTrajectory, "/uam/reference", self.on_reference, 10)
        self.create_subscription(JointTrajectory, "/uam/state", self.on_state, 10)

    def on_reference(self, message):
        self.reference = arm(message)

    def on_state(self, message):
        tau = [0.0, 0.0]
        if self.reference is not None:
            for i, ((a, a_dot), (wanted, wanted_dot)) in enumerate(
                zip(arm(message), self.reference, strict=True)
            ):
                self.integral[i] += K_I * PERIOD * (wanted - a)
                total = K_P * (wanted - a) + K_D * (wanted_dot - a_dot) + self.integral[i]
                tau[i] = max(-TORQUE_MAX, min(TORQUE_MAX, total))
        self.effort.publish(Float64MultiArray(data=tau))
        points = [JointTrajectoryPoint(effort=tau)]
        self.command.publish(
            JointTrajectory(header=message.header, joint_names=JOINTS, points=points)
        )


def arm(message):
    """Angle [rad] and rate [rad/s] of both joints of a /uam/state or /uam/reference."""
    point, rows = message.points[0], [list(message.joint_names).index(j) for j in JOINTS]
    return [(point.positions[row], point.velocities[row]) for row in rows]


if __name__ == "__main__":
    rclpy.init()
    try:
        rclpy.spin(OwnArmController())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
