"""Example of a user's own controller: PID for the arm's two joints replaces arm_controller.

    uam fly --scenario hover --without arm_controller      prints the ROS domain, for instance 1
    ROS_DOMAIN_ID=1 python examples/own_controller.py      in another terminal

The node has the name of the replaced node, subscribes to /uam/state, and publishes one effort for
each state. /uam/arm/command is only for log and report.
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
    """PID on the joint angles; the integral compensates the arm's weight."""

    def __init__(self):
        super().__init__("arm_controller")
        self.reference, self.integral = None, [0.0, 0.0]
        effort = "arm_effort_controller/commands"
        self.effort = self.create_publisher(Float64MultiArray, effort, 10)
        self.command = self.create_publisher(JointTrajectory, "uam/arm/command", 10)
        self.create_subscription(JointTrajectory, "uam/reference", self.on_reference, 10)
        self.create_subscription(JointTrajectory, "uam/state", self.on_state, 10)

    def on_reference(self, message):
        self.reference = arm(message)

    def on_state(self, message):
        tau = [0.0, 0.0]
        if self.reference is not None:
            for i, ((a, a_dot), (a_d, a_d_dot)) in enumerate(
                zip(arm(message), self.reference, strict=True)
            ):
                self.integral[i] += K_I * PERIOD * (a_d - a)
                total = K_P * (a_d - a) + K_D * (a_d_dot - a_dot) + self.integral[i]
                tau[i] = max(-TORQUE_MAX, min(TORQUE_MAX, total))
        self.effort.publish(Float64MultiArray(data=tau))
        points = [JointTrajectoryPoint(effort=tau)]
        self.command.publish(
            JointTrajectory(header=message.header, joint_names=JOINTS, points=points)
        )


def arm(message):
    """Return angle [rad] and rate [rad/s] of both joints from /uam/state or /uam/reference."""
    point, rows = message.points[0], [list(message.joint_names).index(j) for j in JOINTS]
    return [(point.positions[row], point.velocities[row]) for row in rows]


if __name__ == "__main__":
    rclpy.init()
    try:
        rclpy.spin(OwnArmController())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
