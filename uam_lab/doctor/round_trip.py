"""Child processes of the ROS check: one answers, the other sends and measures.

    python -m uam_lab.doctor.round_trip answer|ask

They use two topics in the ROS domain of their environment. `ask` prints lines of JSON: file and
middleware of rclpy, time of the discovery, and time of a message there and back.
"""

from __future__ import annotations

import statistics
import sys
import time

from uam_lab.doctor.check_process import say

THERE, BACK = "/uam/doctor/there", "/uam/doctor/back"
COUNT = 50  # messages
DISCOVERY, ANSWER = 15.0, 2.0  # [s] longest waits


def main() -> int:
    """Answer or ask; return the exit status."""
    try:
        import rclpy
        from std_msgs.msg import Float64
    except Exception as error:  # a broken library may raise anything
        print(f"{type(error).__name__}: {error}".splitlines()[0])
        return 1
    say(file=rclpy.__file__, rmw=rclpy.get_rmw_implementation_identifier())
    rclpy.init()
    node = rclpy.create_node(f"uam_doctor_{sys.argv[1]}")
    if sys.argv[1] == "answer":
        back = node.create_publisher(Float64, BACK, 10)
        node.create_subscription(Float64, THERE, back.publish, 10)
        rclpy.spin(node)
        return 0
    heard: list[float] = []
    there = node.create_publisher(Float64, THERE, 10)
    node.create_subscription(Float64, BACK, lambda message: heard.append(message.data), 10)

    def until_heard(value: float, patience: float) -> bool:
        end = time.monotonic() + patience
        while value not in heard and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.05)
        return value in heard

    begun = time.monotonic()
    while not until_heard(-1.0, 0.1):  # repeated until the discovery is complete
        there.publish(Float64(data=-1.0))
        if time.monotonic() - begun > DISCOVERY:
            print(f"the two processes did not find each other within {DISCOVERY:g} s")
            return 1
    say(discovery_s=time.monotonic() - begun)
    times = []
    for number in range(COUNT):
        sent = time.perf_counter()
        there.publish(Float64(data=float(number)))
        if not until_heard(float(number), ANSWER):
            print(f"message {number} of {COUNT} did not come back within {ANSWER:g} s")
            return 1
        times.append(time.perf_counter() - sent)
    say(median_s=statistics.median(times), longest_s=max(times))
    return 0


if __name__ == "__main__":
    sys.exit(main())
