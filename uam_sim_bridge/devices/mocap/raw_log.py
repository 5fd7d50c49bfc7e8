"""Recorded poses of one rigid body in the tracker's axes, as CSV."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uam_control.settings.csv_table import CsvTable
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError
from uam_sim_bridge.devices.mocap.measurement import TimedPose

COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")  # s, m
SLOWEST = 0.5  # [s] between two poses; in ms or us they are farther apart
ROOM = 50.0  # [m] in which a recording is; in mm it is larger


def write(file: Path, poses: Sequence[TimedPose]) -> None:
    """Write the poses; raises OSError."""
    with file.open("w", newline="", encoding="utf-8") as out:
        rows = csv.writer(out)
        rows.writerow(COLUMNS)
        for time, (position, quaternion) in poses:
            numbers = *position, *quaternion
            rows.writerow([f"{time:.6f}", *(f"{number:.9g}" for number in numbers)])


def read(file: Path) -> list[TimedPose]:
    """Read the poses; raises MocapError with the line, also for other units than s and m."""
    table = CsvTable(file, MocapError)
    missing = [name for name in COLUMNS if name not in table.header]
    if missing:
        needed = f"no column {', '.join(missing)}; needed: {','.join(COLUMNS)}"
        raise table.error(table.header_line, needed)
    found: list[TimedPose] = []
    for line, numbers in zip(table.lines, table.numbers(COLUMNS), strict=True):
        quaternion = np.array(numbers[4:])
        norm = math.sqrt(quaternion @ quaternion)
        if not 0.9 < norm < 1.1:
            raise table.error(line, f"not a pose: the quaternion's norm is {norm:.3g}")
        if found and numbers[0] <= found[-1].time:
            raise table.error(line, "t does not grow")
        pose = BodyPose(np.array(numbers[1:4]), quaternion / norm)
        if found and (far := max(abs(pose.position - found[0].pose.position))) > ROOM:
            apart = f"{far:g} m from the first pose, at most {ROOM:g} m allowed"
            raise table.error(line, f"{apart}; give x, y, z in metres")
        found.append(TimedPose(numbers[0], pose))
    apart = float(np.median(np.diff([one.time for one in found]))) if len(found) > 1 else 0.0
    if apart > SLOWEST:
        raise MocapError(
            f"{file}: column t: poses {apart:g} s apart, at most {SLOWEST:g} s allowed; "
            "give times in seconds"
        )
    return found
