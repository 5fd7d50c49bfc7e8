"""The pre-arm report of a mission: limits, vehicle at rest, whole reference, permission."""

from __future__ import annotations

from uam_control.mission.feasibility import Feasibility, in_words
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.permission import Permission
from uam_control.mission.scenarios.scenario import Scenario
from uam_control.supervision import Observation, PreflightCheck, preflight
from uam_control.supervision.checks import Checks
from uam_control.vehicle import VehicleDescription


class PreArm:
    """The report of one scenario; `permission`: of the checklist."""

    def __init__(
        self, scenario: Scenario, require_checklist: bool, vehicle: VehicleDescription | None
    ) -> None:
        """require_checklist: no flight without its permission; vehicle: with whose limits the
        reference is compared, None: it is not compared."""
        self.permission = Permission(require_checklist)
        self._scenario, self._vehicle = scenario, vehicle
        self._reference: tuple[PreflightCheck, ...] = ()
        self._checked: MissionParameters | None = None  # with which the reference was compared

    def check_reference(self, parameters: MissionParameters) -> None:
        """Compare the whole reference with the limits; the time grows with the flight's length."""
        if self._vehicle is None or parameters == self._checked:
            return
        self._checked = parameters
        check = Feasibility(self._vehicle, parameters, self._scenario.payload_mass)
        found = in_words(check.excesses(self._scenario))
        line = PreflightCheck("reference", found or "within", "within all limits", not found)
        self._reference = (line,)

    def report(
        self, stamp: float, checks: Checks, seen: Observation, parameters: MissionParameters
    ) -> tuple[PreflightCheck, ...]:
        """Return all lines at `stamp` [s]; checks: updated with `seen`."""
        p = parameters
        arm = self._scenario.arm_start
        lines = preflight(checks, seen, arm, p.start_speed, p.start_arm_error)
        return lines + self._reference + self.permission.lines(stamp)
