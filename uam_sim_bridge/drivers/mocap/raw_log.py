"""Recorded poses of one rigid body in the tracker's axes, as CSV."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uam_sim_bridge.drivers.mocap.frame import BodyPose, MocapError
from uam_sim_bridge.drivers.mocap.measurement import TimedPose

COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")  # s, m


def write(file: Path, poses: Sequence[TimedPose]) -> None:
    """Write the poses; raises OSError."""
    with file.open("w", newline="") as out:
        rows = csv.writer(out)
        rows.writerow(COLUMNS)
        for time, (position, quaternion) in poses:
            numbers = *position, *quaternion
            rows.writerow([f"{time:.6f}", *(f"{number:.9g}" for number in numbers)])


def read(file: Path) -> list[TimedPose]:
    """Read the poses; raises MocapError with the line, OSError."""
    found: list[TimedPose] = []
    try:
        rows = csv.DictReader(file.read_text().splitlines())
    except UnicodeDecodeError:
        raise MocapError(f"{file}: not a text in UTF-8") from None
    missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
    if missing:
        raise MocapError(f"{file}: no column {', '.join(missing)}; needed: {','.join(COLUMNS)}")
    for row in rows:
        try:
            numbers = [float(row[name]) for name in COLUMNS]
        except (TypeError, ValueError):
            raise MocapError(f"{file} line {rows.line_num}: not a number") from None
        quaternion = np.array(numbers[4:])
        norm = math.sqrt(quaternion @ quaternion)
        if not (all(map(math.isfinite, numbers)) and 0.9 < norm < 1.1):
            raise MocapError(f"{file} line {rows.line_num}: not a pose")
        if found and numbers[0] <= found[-1].time:
            raise MocapError(f"{file} line {rows.line_num}: t does not grow")
        pose = BodyPose(np.array(numbers[1:4]), quaternion / norm)
        found.append(TimedPose(numbers[0], pose))
    return found
