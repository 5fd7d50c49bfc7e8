"""A person tilts the vehicle on the ground: the laws command rates against it, nothing is sent."""

import math

import numpy as np
import pytest

from uam_control.control.controllers import AttitudeController, PositionController
from uam_control.coordinates import CHI, CHI_DOT, PITCH, ROLL, YAW, Z
from uam_control.mission import ChecklistReport, Mission, StartParameters, load_scenario
from uam_control.mission.mission_output import HAND_CHECK, WAITING
from uam_control.mission.pre_arm import OLDEST
from uam_control.profiles.profile import load_profile
from uam_control.setpoints.rate_thrust_map import RateThrustMap, RateThrustParameters
from uam_control.supervision import Authority, OperatorCommand, Readings, State
from uam_control.vehicle import load_description
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters

DT = 0.004
PROFILES = ("s500", "asmc1", "asmc2")


class Ground:
    """A mission on the ground, and the laws that fly its reference."""

    def __init__(self, profile="s500", **start):
        vehicle, loaded = load_description("s500_arm"), load_profile(profile)
        sets = loaded.sets
        options = {"require_checklist": True} | start
        self.mission = Mission(load_scenario("hover"), sets["mission"], StartParameters(**options))
        self._position = PositionController(sets["position_controller"])
        self._attitude = AttitudeController(sets["attitude_controller"])
        self._map = RateThrustMap(RateThrustParameters.of(vehicle, loaded.bridge()), vehicle)
        self.state, self.time = np.zeros((3, 8)), 0.0
        self.state[CHI, Z], self.state[CHI, 7] = 0.28, math.pi / 2
        self.rates = np.zeros(3)

    def step(self, report=None, armed_since=None):
        """Take a report, and step once with all inputs known; return the mission's output."""
        if report is not None:
            self.mission.checklist(report)
        known = Readings(mocap_age=0.0, joint_age=0.0, controller_age=0.0, autopilot_age=0.0)
        state = self.state
        output = self.mission.step(self.time + DT, state, armed_since, known, Authority())
        tau_p = self._position.update(state, output.reference, output.flying, DT)
        desired = self._position.attitude_reference
        tau_q = self._attitude.update(state, output.reference, desired, output.flying, DT)
        if output.flying:
            self.rates, _ = self._map.map(tau_p, tau_q, state[CHI, 3:6], state[CHI_DOT, 3:6])
        self.time += DT
        return output

    def report(self, passed=False, failing="tilt_roll", commands=True):
        return ChecklistReport(self.time, passed, failing, commands)


def turn(ground, axis, size):
    for i in range(125):
        ground.state[CHI, axis] = size * (i + 1) / 125
        ground.state[CHI_DOT, axis] = size / (125 * DT)
        ground.step(ground.report())
    ground.state[CHI_DOT, axis] = 0.0
    for _ in range(125):
        output = ground.step(ground.report())
    return output


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(
    ("axis", "size"), [(ROLL, 0.2), (ROLL, -0.2), (PITCH, 0.2), (PITCH, -0.2), (YAW, 0.35)]
)
def test_the_laws_of_every_profile_command_rates_against_a_tilt(profile, axis, size):
    ground = Ground(profile)
    for _ in range(10):
        ground.step(ground.report())
    output = turn(ground, axis, size)
    assert output.flying and output.phase == HAND_CHECK and not output.arm
    against = -np.sign(size) * ground.rates[axis - ROLL]
    assert against >= ChecklistParameters().rate_response
    assert np.max(np.abs(np.delete(ground.rates, axis - ROLL))) < against


def test_without_the_request_only_the_arm_is_commanded():
    ground = Ground()
    assert ground.step(ground.report(commands=False)).phase == WAITING
    ground.step(ground.report())
    output = ground.step(ground.report())
    assert output.flying
    output = ground.step(ground.report(commands=False))
    assert not output.flying and output.phase == WAITING
    assert not output.reference[CHI, :6].any()


def test_a_vehicle_that_somebody_else_armed_gets_no_commands():
    ground = Ground()
    ground.step(ground.report())
    assert ground.step(ground.report()).flying
    output = ground.step(ground.report(), armed_since=ground.time)
    assert not output.flying and output.phase == WAITING
    assert not output.reference[CHI, :6].any()


def test_where_no_checklist_is_required_it_commands_nothing():
    ground = Ground(require_checklist=False)
    assert not ground.step(ground.report()).flying
    assert ground.mission.start()[0]


def test_an_old_report_commands_nothing():
    ground = Ground()
    report = ground.report()
    ground.step(report)
    ground.time += OLDEST + 1.0
    assert not ground.step().flying


def test_a_start_is_refused_with_the_failing_items():
    ground = Ground()
    ground.step()
    assert ground.mission.start() == (
        False, "refused: checklist: no report (all items passed)",
    )  # fmt: skip
    ground.step(ground.report(failing="battery; tilt_roll", commands=False))
    assert ground.mission.start()[1] == (
        "refused: checklist: battery; tilt_roll (all items passed)"
    )
    ground.step(ground.report(passed=True, failing="", commands=False))
    assert ground.mission.start() == (True, "arming")


def test_auto_start_waits_for_the_checklist():
    ground = Ground(auto_start=True)
    for _ in range(5):
        assert not ground.step(ground.report(commands=False)).arm
    ground.step(ground.report(passed=True, failing="", commands=False))
    assert ground.step().arm


def test_the_permission_that_is_taken_back_before_arming_ends_the_flight():
    ground = Ground()
    ground.step(ground.report(passed=True, failing="", commands=False))
    ground.mission.start()
    assert ground.step(ground.report(passed=True, failing="", commands=False)).arm
    output = ground.step(ground.report(failing="battery", commands=False))
    assert output.state is State.DISARMED and not output.arm
    assert output.abort_reason == "checklist: battery (all items passed)"


def test_a_silent_checklist_is_no_permission():
    ground = Ground()
    ground.step(ground.report(passed=True, failing="", commands=False))
    ground.time += OLDEST + 1.0
    ground.step()
    assert ground.mission.start()[1].startswith("refused: checklist: silent for 4 s")


def test_an_armed_vehicle_flies_on_without_the_checklist():
    ground = Ground()
    ground.step(ground.report(passed=True, failing="", commands=False))
    ground.mission.start()
    ground.step()
    output = ground.step(ground.report(failing="battery", commands=False), armed_since=ground.time)
    assert output.arm and output.state is State.GROUNDED
    assert ground.mission.request(OperatorCommand.DISARM)[0]
