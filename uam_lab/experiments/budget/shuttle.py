"""A scenario of any duration: the vehicle flies to and fro and moves its arm."""

import math

import yaml

CYCLE = 20.0  # [s] there and back
JOINTS = ["alpha_1", "alpha_2"]
REST = 90.0  # [deg] of the second joint at rest


def shuttle(duration: float, arm: bool = True) -> str:
    """Return the YAML of a scenario of about `duration` [s]; arm: move the joints JOINTS."""
    moves = [{"coordinate": "z", "from": 0, "until": 3, "to": 1.0}]
    begin, half = 4.0, CYCLE / 2.0
    cycles = max(1, math.floor((duration - begin - 7.0) / CYCLE))
    for cycle in range(cycles):
        at = begin + cycle * CYCLE
        for since, x, alpha in ((at, 1.0, 45.0), (at + half, 0.0, 0.0)):
            span = {"from": since, "until": since + half}
            moves.append({"coordinate": "x", **span, "to": x})
            if arm:
                angles = zip(JOINTS, (alpha, REST - alpha), strict=True)
                moves += [{"coordinate": name, **span, "to_deg": to} for name, to in angles]
    land = begin + cycles * CYCLE + 1.0
    phases = [("take-off", 0.0), ("shuttle", begin), ("land", land)]
    return yaml.safe_dump(
        {
            "description": f"To and fro for {duration / 60.0:g} minutes.",
            **({"arm_start": {"alpha_1_deg": 0, "alpha_2_deg": REST}} if arm else {}),
            "phases": [{"from": since, "name": name} for name, since in phases],
            "moves": moves,
            "landing": {"at": land, "duration": 5},
        }
    )
