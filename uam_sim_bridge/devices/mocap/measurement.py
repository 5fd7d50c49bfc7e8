"""Mean pose of a body that stands still, and the refusal of one that does not.

Its poses come from the running system, or from a recording: CSV, in the tracker's axes.
"""

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uam_control.settings.atomic import write_rows
from uam_control.settings.csv_table import CsvTable
from uam_control.stamps import SECOND
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError, MocapSource, unknown_body

FEWEST = 60  # poses, half a second at 120 Hz
# A tracker has some 0.4 mm and 0.1 deg of noise; a vehicle that is held by hand moves more.
MOVED = 0.003  # [m]
TURNED = math.radians(0.5)
ANSWER_TIME = 5.0  # [s] for the system to answer
COLUMNS = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")  # s, m
SLOWEST = 0.5  # [s] between two poses; in ms or us they are farther apart
ROOM = 50.0  # [m] in which a recording is; in mm it is larger


class TimedPose(NamedTuple):
    """A pose of the tracker at `time` [s]."""

    time: float
    pose: BodyPose


class StillPose(NamedTuple):
    """Mean of several poses, tracker's axes."""

    position: np.ndarray  # (3,) [m]
    quaternion: np.ndarray  # (4,) [w x y z]
    spread: float  # [m] root mean square of the distances from the mean
    wobble: float  # [rad] the same
    count: int  # of the poses


def still(poses: Sequence[TimedPose], what: str) -> StillPose:
    """Return the mean pose; raise MocapError if there are too few poses or the body moved.

    what: the place, for messages. Slow motion counts, too: the halves are compared.
    """
    if len(poses) < FEWEST:
        raise MocapError(f"{what}: {len(poses)} poses, at least {FEWEST} are needed")
    mean = _mean(poses)
    half = len(poses) // 2
    first, second = _mean(poses[:half]), _mean(poses[half:])
    moved = max(mean.spread, float(np.linalg.norm(second.position - first.position)))
    turned = max(mean.wobble, angle_between(first.quaternion, second.quaternion))
    if moved > MOVED or turned > TURNED:
        raise MocapError(
            f"{what}: the vehicle moved during the measurement, {1e3 * moved:.1f} mm and "
            f"{math.degrees(turned):.2f} deg; allowed: {1e3 * MOVED:.1f} mm and "
            f"{math.degrees(TURNED):.2f} deg"
        )
    return mean


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle [rad] between two unit quaternions (4,)."""
    return 2.0 * math.acos(min(1.0, abs(float(a @ b))))


def places(poses: Sequence[TimedPose], duration: float) -> list[Sequence[TimedPose]]:
    """Return the stretches of a recording, of `duration` [s] at least, in which the body is still.

    A pose belongs to a stretch while it is closer than 2 MOVED and 2 TURNED to the stretch's
    first pose. The ends of a stretch, where the body was set down or lifted, are left out.
    """
    found, begin = [], 0
    for i in range(1, len(poses) + 1):
        if i < len(poses) and _close(poses[begin].pose, poses[i].pose):
            continue
        if poses[i - 1].time - poses[begin].time >= duration:
            tenth = (i - begin) // 10
            found.append(poses[begin + tenth : i - tenth])
        begin = i
    return found


def _close(a: BodyPose, b: BodyPose) -> bool:
    near = float(np.linalg.norm(b.position - a.position)) < 2.0 * MOVED
    return near and angle_between(a.quaternion, b.quaternion) < 2.0 * TURNED


def _mean(poses: Sequence[TimedPose]) -> StillPose:
    """The mean quaternion is the largest eigenvector of the sum of q qᵀ (Markley 2007)."""
    positions = np.array([one.pose.position for one in poses])
    quaternions = np.array([one.pose.quaternion for one in poses])
    quaternion = np.linalg.eigh(quaternions.T @ quaternions)[1][:, -1]
    position = positions.mean(axis=0)
    spread = math.sqrt(float(np.mean(np.sum((positions - position) ** 2, axis=1))))
    angles = [angle_between(quaternion, one) for one in quaternions]
    wobble = math.sqrt(float(np.mean(np.square(angles))))
    return StillPose(position, quaternion, spread, wobble, len(poses))


def until_known(source: MocapSource, body: str) -> None:
    """Wait until the system knows the body; raise MocapError with the bodies that there are."""
    deadline = time.monotonic() + ANSWER_TIME
    while time.monotonic() < deadline:
        source.frames(0.05)
        if source.names is not None and body in source.names:
            return
    if source.names is None:
        raise MocapError(f"no answer of {source.description}; is it on, and does it stream?")
    raise MocapError(unknown_body(source, [body]))


def tracked_poses(source: MocapSource, body: str, duration: float) -> list[TimedPose]:
    """Return the tracked poses of the next `duration` [s]; raise MocapError if there are none."""
    while source.frames(0.0):  # those that arrived before
        pass
    found: list[TimedPose] = []
    frames, deadline = 0, time.monotonic() + duration
    while time.monotonic() < deadline:
        for frame in source.frames(0.05):
            frames += 1
            pose = frame.bodies.get(body)
            if pose is not None and not (found and frame.arrival / SECOND <= found[-1].time):
                found.append(TimedPose(frame.arrival / SECOND, pose))
    if not frames:
        raise MocapError(f"no frames from {source.description}; is it paused?")
    if not found:
        raise MocapError(f"body '{body}' is not tracked: markers hidden or out of sight")
    return found


def write_poses(file: Path, poses: Sequence[TimedPose]) -> None:
    """Write the poses; raises OSError."""
    rows = (
        [f"{time:.6f}", *(f"{number:.9g}" for number in (*position, *quaternion))]
        for time, (position, quaternion) in poses
    )
    write_rows(file, COLUMNS, rows)


def read_poses(file: Path) -> list[TimedPose]:
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
