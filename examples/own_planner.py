"""Your own planner: it computes a circle and sends it as a trajectory of the base.

    python examples/own_planner.py [FOLDER]

The mission checks the trajectory against its limits before it replaces what is flown. The same
message may come from any other process, on the topic base_trajectory (docs/scenarios.md).
"""

import math
import sys
from pathlib import Path

from geometry_msgs.msg import Transform
from rclpy.duration import Duration
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from uam_lab import Flight
from uam_lab.records.results.result_folder import new_folder

RADIUS, ROUND, STEP = 0.4, 6.0, 0.25  # [m], [s], [s]


def circle(height: float) -> MultiDOFJointTrajectory:
    """Return one round through (0, 0), from rest to rest; yaw stays 0."""
    plan = MultiDOFJointTrajectory(joint_names=["base_link"])
    plan.header.frame_id = "world"
    for k in range(1, round(ROUND / STEP) + 1):
        share = k * STEP / ROUND
        angle = 2.0 * math.pi * share**2 * (3.0 - 2.0 * share)  # at rest at both ends
        pose = Transform()
        pose.translation.x = RADIUS * math.sin(angle)
        pose.translation.y = RADIUS * (1.0 - math.cos(angle))
        pose.translation.z = height
        point = MultiDOFJointTrajectoryPoint(transforms=[pose])
        point.time_from_start = Duration(seconds=k * STEP).to_msg()
        plan.points.append(point)
    return plan


def main():
    """Take off, fly the circle, land."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else new_folder(Path("results"), "planner")
    with Flight(scenario="hover", out=out) as flight:
        flight.wait_for("hover")
        print(flight.plan(circle(1.0)))
        flight.wait_for("goal")
        flight.wait_for("holding")
        flight.land()
        result = flight.wait()
    east = result["truth.x"][result.phase() == "goal"]
    print(f"circle: {east.min():.2f} to {east.max():.2f} m east; {result.reason or 'completed'}")


if __name__ == "__main__":
    main()
