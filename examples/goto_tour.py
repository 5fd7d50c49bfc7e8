"""A tour of goals: take off, fly to some places one after the other, bring the hand to one, land.

python examples/goto_tour.py [FOLDER]
"""

import math
import sys
from pathlib import Path

from uam_lab import CommandRefused, Flight
from uam_lab.records.results.result_folder import new_folder

TOUR = [(0.5, 0.0, 1.0, 0.0), (0.5, 0.5, 1.2, 45.0), (0.0, 0.5, 1.0, 90.0), (0.0, 0.0, 1.0, 45.0)]
FAST = {"goal_speed": 0.6, "goal_yaw_rate": 1.0}  # [m/s], [rad/s]: the largest on the way


def main():
    """Fly the tour; print each goal, and where the vehicle was when it held there."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else new_folder(Path("results"), "tour")
    with Flight(scenario="hover", parameters={"mission": FAST}, out=out) as flight:
        flight.wait_for("hover")
        for x, y, z, degrees in TOUR:  # [m, ENU], [deg]
            print(f"({x}, {y}, {z}):", flight.goto(x, y, z, math.radians(degrees)))
            flight.wait_for("goal")
            held = flight.wait_for("holding")
            print(f"  there at {held.time:.1f} s, {1000.0 * held.position_error:.1f} mm off")
        print("hand to (0.4, 0.2, 0.7):", flight.hand.goto(0.4, 0.2, 0.7))
        flight.wait_for("goal")
        flight.wait_for("holding")
        at = flight.hand.pose.pose.position
        print(f"  hand: {1000.0 * math.dist((at.x, at.y, at.z), (0.4, 0.2, 0.7)):.1f} mm off")
        try:
            flight.goto(99.0, 0.0, 1.0)
        except CommandRefused as refusal:
            print("too far:", refusal)
        try:
            flight.hand.goto(0.4, 0.2, -0.1)
        except CommandRefused as refusal:
            print("too low:", refusal)
        print(flight.land())
        result = flight.wait()
    print("landed:", result.outcome.transitions[-1]["cause"])


if __name__ == "__main__":
    main()
