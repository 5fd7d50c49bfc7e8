"""Alignment of the tool before its last way to the payload, mostly a descent.

The correction contains the place of the payload and the mean attitude and joint errors, which no
other part corrects. It leaves out the position error: the position law corrects it, and a second
correction of the same error would follow every gust. It leaves out the path that is still ahead,
too: otherwise a vehicle that arrives just before the descent would count as beside the payload.
"""

import math

import numpy as np

from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import RunningMean, Sight
from uam_control.grasp.windows import FROM_ABOVE, GraspWindow

SPAN = 0.5  # [s] shortest time over which an alignment is judged
PAUSE = 2.0  # [s] between two corrections
SHALLOW, DEEP = 0.1, 2.5  # of press_depth: allowed depths of the planned contact
WORTH = 0.002  # [m] smallest correction


class Alignment:
    """Mean distance of the tool from the payload, and the corrections of the path.

    Distances are across the approach and back along it, see `Approach.axes`: from above x, y, z.

    Without a tracked payload the distance is the position error: the payload is where the scenario
    has it. A tracked payload also gives the depth of the planned contact.
    """

    def __init__(self) -> None:
        self._distance, self._constant = RunningMean(), RunningMean()
        self._stamp = 0.0
        self._corrected: float | None = None  # stamp [s] of the last correction
        self._tracked = self._shifting = False
        self._axes = FROM_ABOVE.axes

    def restart(self) -> None:
        """Forget all values."""
        self._distance.restart()
        self._constant.restart()
        self._corrected = None

    def add(self, sight: Sight, window: GraspWindow) -> None:
        """Add a sight before the approach of a window."""
        self._axes = window.approach.axes
        if sight.tracked != self._tracked:
            self.restart()
            self._tracked = sight.tracked
        self._stamp, self._shifting = sight.stamp, sight.shifting
        if sight.tracked:
            way = sight.tool + sight.ahead - sight.payload - window.back
            away = self._axes @ way
            self._constant.add(sight.stamp, self._axes @ (way - sight.error))
        else:
            away = self._axes @ sight.error * [1.0, 1.0, 0.0]
        self._distance.add(sight.stamp, away)

    @property
    def known(self) -> bool:
        """Whether the distance was measured for long enough."""
        return self._distance.span(self._stamp) >= SPAN

    @property
    def distance(self) -> float:
        """Mean distance across [m]."""
        return float(np.hypot(*self._distance.mean[:2]))

    @property
    def swing(self) -> float:
        """Standard deviation [m] of the distance across."""
        return float(np.hypot(*self._distance.deviation[:2]))

    def good(self, p: GraspParameters, factor: float = 1.0) -> bool:
        """Return whether the approach may begin; factor: on the tolerances across."""
        if not self.known:
            return False
        z = self._constant.mean[2] if self._tracked else 0.0
        level = not self._tracked or -DEEP * p.press_depth <= z <= -SHALLOW * p.press_depth
        near = self.distance <= factor * p.align_tolerance
        return near and self.swing <= factor * p.align_swing and (level or factor > 1.0)

    @property
    def text(self) -> str:
        """The distance as text."""
        of = "payload" if self._tracked else "path"
        return f"{1e3 * self.distance:.0f} mm off the {of}, swing {1e3 * self.swing:.0f} mm"

    def near(self, distance: float) -> bool:
        """Return whether the payload is within `distance` [m] of its place on the path, across and
        along the approach; known."""
        if not self.known:
            return False
        x, y, z = (self._constant if self._tracked else self._distance).mean.tolist()
        return max(math.hypot(x, y), abs(z)) <= distance

    def settled(self) -> bool:
        """Return whether the distance was measured for PAUSE: longer than a gust."""
        return self._distance.span(self._stamp) >= PAUSE

    def correction(self, shift: np.ndarray, p: GraspParameters, worth: float = WORTH) -> np.ndarray:
        """Return the new shift (3,) [m] of the path in place of `shift` (3,).

        It is the same if no correction is due, or the correction is below `worth` [m].
        """
        settled = self._corrected is None or self._stamp - self._corrected >= PAUSE
        if self._shifting or not (self._tracked and settled and self.known):
            return shift
        away = self._constant.mean + [0.0, 0.0, p.press_depth]
        if float(np.max(np.abs(away))) < worth:
            return shift
        self._corrected = self._stamp
        return np.clip(shift - self._axes.T @ away, -p.align_range, p.align_range)
