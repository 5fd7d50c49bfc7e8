"""What the control laws follow on the ground: nothing, the pose of a dry run, or that in hands."""

from __future__ import annotations

import numpy as np

from uam_control.coordinates import ALPHA, ATTITUDE, CHI, YAW
from uam_control.mission.mission_output import DRY_RUN, HAND_CHECK, MissionOutput


class GroundPose:
    """Writes the reference of a vehicle that has not started, and says that it flies.

    The laws then compute commands, which nobody obeys: nothing is armed.
    """

    def __init__(self) -> None:
        self._pose: np.ndarray | None = None  # (6 + n,) at the begin

    def dry_run(self, output: MissionOutput, state: np.ndarray) -> None:
        """Follow the pose of the first finite state (3, 6 + n), level."""
        if self._pose is None and np.all(np.isfinite(state)):
            self._pose = state[CHI].copy()
            self._pose[ATTITUDE] = 0.0, 0.0, state[CHI, YAW]
        if self._pose is not None:
            output.reference[CHI, :ALPHA] = self._pose[:ALPHA]
            output.flying, output.phase = True, DRY_RUN

    def hand_check(self, output: MissionOutput, state: np.ndarray, looks: bool) -> None:
        """Let the control laws work while the checklist `looks` at their commands.

        The reference is the present position, level, with the heading of the beginning: the laws
        then turn the vehicle back. state (3, 6 + n).
        """
        if not looks or not np.all(np.isfinite(state)):
            if self._pose is not None:
                self._pose = None
                output.reference[CHI, :ALPHA] = 0.0
            return
        if self._pose is None:
            self._pose = state[CHI].copy()
        output.reference[CHI, :ALPHA] = state[CHI, :ALPHA]
        output.reference[CHI, ATTITUDE] = 0.0, 0.0, self._pose[YAW]
        output.flying, output.phase = True, HAND_CHECK
