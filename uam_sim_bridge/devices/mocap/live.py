"""Poses of one body from the running system, for a measurement."""

from __future__ import annotations

import time

from uam_control.stamps import SECOND
from uam_sim_bridge.devices.mocap.frame import MocapError, MocapSource
from uam_sim_bridge.devices.mocap.measurement import TimedPose

ANSWER_TIME = 5.0  # [s] for the system to answer


def until_known(source: MocapSource, body: str) -> None:
    """Wait until the system knows the body; raise MocapError with the bodies that there are."""
    deadline = time.monotonic() + ANSWER_TIME
    while time.monotonic() < deadline:
        source.frames(0.05)
        if source.names is not None and body in source.names:
            return
    if source.names is None:
        raise MocapError(f"no answer of {source.description}; is it on, and does it stream?")
    there = ", ".join(sorted(source.names)) or "none"
    raise MocapError(f"no rigid body '{body}' in {source.description}; there are: {there}")


def measure(source: MocapSource, body: str, duration: float) -> list[TimedPose]:
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
