"""The pre-arm report of a mission: limits, vehicle at rest, whole reference, permission.

The permission is that of the checklist, see docs/preflight.md.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, CHI, POSITION, YAW
from uam_control.mission.feasibility import Feasibility, in_words
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.scenarios.scenario import Scenario
from uam_control.supervision import Observation, PreflightCheck, preflight
from uam_control.supervision.checks import Checks
from uam_control.vehicle import VehicleDescription

MOVED = 0.02  # [m, rad] from which on a vehicle on the ground stands in another place
OLDEST = 3.0  # [s] age of a report that still counts; it comes several times a second


@dataclass(frozen=True)
class ChecklistReport:
    """Newest state of the checklist."""

    stamp: float  # [s]
    passed: bool
    failing: str = ""  # names of the items that have not passed
    commands: bool = False  # a person tilts the vehicle and looks at the commanded body rates


class PreArm:
    """The report of one scenario."""

    def __init__(
        self,
        scenario: Scenario,
        require_checklist: bool,
        vehicle: VehicleDescription | None,
        compared: bool = False,
    ) -> None:
        """require_checklist: no flight without its permission; vehicle: with whose limits the
        reference is compared, None: it is not compared; compared: from the origin, it was before.
        """
        self.checklist: ChecklistReport | None = None  # its newest report
        self._required = require_checklist
        self._scenario, self._vehicle, self._compared = scenario, vehicle, compared
        self._stands: np.ndarray | None = None  # (4,) place and yaw of the line below
        self._place: tuple[PreflightCheck, ...] = ()
        self._reference: tuple[PreflightCheck, ...] = ()
        self._checked: MissionParameters | None = None  # with which the reference was compared
        self.stands = math.inf  # [s] delay of the setpoints that the reference stands

    def check_reference(self, parameters: MissionParameters) -> None:
        """Compare the whole reference with the limits; the time grows with the flight's length."""
        if self._vehicle is None or parameters == self._checked:
            return
        self._checked, self._stands = parameters, None
        check = Feasibility(self._vehicle, parameters, self._scenario.payload_mass)
        excesses, stands = check.examined(self._scenario)
        # setpoints are never earlier than nominal, which every profile stands
        self.stands, found = max(stands, parameters.delay_nominal), in_words(excesses)
        if not self._compared:
            line = PreflightCheck("reference", found or "within", "within all limits", not found)
            self._reference = (line,)

    def report(
        self, stamp: float, checks: Checks, seen: Observation, parameters: MissionParameters
    ) -> tuple[PreflightCheck, ...]:
        """Return all lines at `stamp` [s]; checks: updated with `seen`."""
        p = parameters
        arm = self._scenario.arm_start
        lines = preflight(checks, seen, arm, p.start_speed, p.start_arm_error)
        self._look_at_place(seen.state[CHI], p)
        return lines + self._reference + self._place + self._permission(stamp)

    def _permission(self, now: float) -> tuple[PreflightCheck, ...]:
        """Return the checklist's line at `now` [s], () where it is not required."""
        if not self._required:
            return ()
        value, report = "passed", self.checklist
        if report is None:
            value = "no report"
        elif self._old(now):
            value = f"silent for {now - report.stamp:.0f} s"
        elif not report.passed:
            value = report.failing or "not passed"
        return (PreflightCheck("checklist", value, "all items passed", value == "passed"),)

    def refusal(self, now: float) -> str:
        """Return why there is no permission at `now` [s], in one line; "" if there is."""
        return "".join(line.text for line in self._permission(now) if not line.passed)

    def hand_check(self, now: float) -> bool:
        """Return whether body rates are to be computed for a vehicle in the hands of a person."""
        report = self.checklist
        return self._required and report is not None and report.commands and not self._old(now)

    def _old(self, now: float) -> bool:
        return abs(now - self.checklist.stamp) > OLDEST

    def _look_at_place(self, chi: np.ndarray, parameters: MissionParameters) -> None:
        """Compare the first moves from where the vehicle stands, chi (6 + n,), with the limits.

        A person who carries the vehicle sees when its place is near enough.
        """
        stands = np.append(chi[POSITION], chi[YAW])
        if self._vehicle is None or not np.isfinite(stands).all():
            return
        if self._stands is not None and np.abs(stands - self._stands).max() < MOVED:
            return
        self._stands, start = stands, chi.copy()
        start[ATTITUDE] = 0.0, 0.0, chi[YAW]
        start[ARM] = self._scenario.arm_start
        check = Feasibility(self._vehicle, parameters, self._scenario.payload_mass)
        found = in_words(check.from_place(self._scenario, start))
        limit = "the first moves from here within all limits: carry it nearer to their end"
        self._place = (PreflightCheck("place", found or "near enough", limit, not found),)
