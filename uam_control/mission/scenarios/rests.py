"""Moves between rests, found in the samples of a trajectory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uam_control.mission.motion.trajectory import Move

SLOW = 1e-3  # [m/s], [rad/s] below which a coordinate rests


def between_rests(times: np.ndarray, values: Mapping[str, np.ndarray]) -> tuple[Move, ...]:
    """Return the moves of coordinates between rests and turns.

    times (m,) [s]; values: coordinate -> samples (m,) [m or rad]. The height has a move that ends
    at the first sample: the way there.
    """
    found = [Move("z", float(times[0]) - 1.0, float(times[0]), float(values["z"][0]))]
    for name, samples in values.items():
        rates = np.diff(samples) / np.diff(times)
        ways = np.where(np.abs(rates) > SLOW, np.sign(rates), 0.0)
        edges = np.flatnonzero(np.diff(ways, prepend=0.0, append=0.0))
        for first, last in zip(edges, edges[1:], strict=False):
            if ways[first]:
                found.append(
                    Move(name, float(times[first]), float(times[last]), float(samples[last]))
                )
    return tuple(found)
