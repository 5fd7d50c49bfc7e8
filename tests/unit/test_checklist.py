"""The checklist: automatic items, the order of the steps, permission, record, readings."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.supervision import PreflightCheck
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters
from uam_lab.preflight.checklist.automatic import automatic
from uam_lab.preflight.checklist.checklist import Checklist, record
from uam_lab.preflight.checklist.guided import ConfirmStep, KillStep, MagnetStep, guided
from uam_lab.preflight.checklist.host import HostReader, governors
from uam_lab.preflight.checklist.observation import (
    BAD,
    GOOD,
    Box,
    Host,
    NodeReport,
    Observation,
    Resting,
    Sample,
    Stream,
    StreamReport,
)
from uam_lab.preflight.checklist.step import CONFIRM, Situation, StepState
from uam_msgs_py.messages.checklist import checklist_message, read_checks
from uam_msgs_py.messages.status import ChecklistState, RadioState

LIMITS = ChecklistParameters()
JOINTS = ("alpha_1", "alpha_2")
STOWED = np.array([0.0, math.pi / 2])
NODES = ("mission", "mavlink_bridge", "recorder", "state_estimator", "arm_driver")


def standing(**changes):
    """A vehicle that stands: exact means, or with `changes`."""
    values = {
        "position": np.array([0.1, -0.2, 0.05]),
        "joints": STOWED.copy(),
        "tilt": 0.01,
        "gravity_angle": 0.01,
        "force": 9.81,
        "rate": 0.002,
        "spread": 0.001,
    }
    return Resting(**(values | changes))


def good(**changes):
    """An observation of which every item passes."""
    seen = Observation(
        expected=NODES,
        joint_names=JOINTS,
        stowed=STOWED,
        control_rate=250.0,
        nodes={name: NodeReport(0.4, GOOD, "running", {}) for name in NODES},
        mocap=StreamReport(120.0, 0.009, 0.0),
        imu=StreamReport(250.0, 0.005, 0.0),
        joint_states=StreamReport(250.0, 0.005, 0.0),
        pose_age=0.012,
        resting=standing(),
        temperatures={"alpha_1": 30.0, "alpha_2": 31.0},
        battery=0.95,
        connected=True,
        killed=False,
        radio=True,
        parameters_read=True,
        fence=Box((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5)),
        room=Box((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5)),
        preflight=(PreflightCheck("mocap", "0.01 s", "at most 0.1 s", True),),
        host=Host(5e10, True, 0.0, ("performance",) * 4, 99.0),
    )
    for name, value in changes.items():
        setattr(seen, name, value)
    return seen


def failed(seen, limits=LIMITS):
    return {one.name: one.value for one in automatic(seen, limits) if not one.passed}


def test_a_good_vehicle_passes_every_item():
    assert failed(good()) == {}


def hot(name, value):
    return NodeReport(0.4, GOOD, "running", {name: value})


@pytest.mark.parametrize(
    ("changes", "item", "value"),
    [
        ({"nodes": {}}, "nodes", "mission: no diagnostics; "),
        ({"mocap": None}, "mocap rate", "unknown"),
        ({"mocap": StreamReport(60.0, 0.02, 0.0)}, "mocap rate", "60 Hz"),
        ({"mocap": StreamReport(120.0, 0.3, 0.0)}, "mocap gap", "300 ms"),
        ({"mocap": StreamReport(118.0, 0.02, 0.05)}, "mocap losses", "5 %"),
        ({"pose_age": 0.08}, "mocap latency", "80 ms"),
        ({"pose_age": None}, "mocap latency", "unknown"),
        ({"resting": None}, "mocap level", "unknown"),
        ({"resting": standing(tilt=0.1)}, "mocap level", "0.1 rad"),
        ({"resting": standing(gravity_angle=1.57)}, "mocap and IMU vertical", "1.57 rad"),
        ({"resting": standing(force=8.5)}, "gravity", "1.31 m/s^2"),
        ({"resting": standing(rate=0.2)}, "gyro at rest", "0.2 rad/s"),
        ({"resting": standing(spread=0.1)}, "at rest", "0.1 m"),
        ({"imu": StreamReport(125.0, 0.01, 0.0)}, "IMU rate", "125 Hz"),
        ({"joint_states": StreamReport(100.0, 0.01, 0.0)}, "joint state rate", "100 Hz"),
        ({"resting": standing(joints=STOWED + [0.0, -0.5])}, "joints at stow", "alpha_2 0.5 rad"),
        ({"temperatures": {"alpha_1": 30.0}}, "servo temperature", "unknown"),
        ({"temperatures": {"alpha_1": 30.0, "alpha_2": 61.0}}, "servo temperature", "61 deg C"),
        ({"battery": 0.4}, "battery", "40 %"),
        ({"battery": math.nan}, "battery", "unknown"),
        ({"connected": False}, "autopilot", "no heartbeat"),
        ({"radio": False}, "radio", "not received"),
        ({"radio": None}, "radio", "unknown"),
        ({"killed": True}, "kill switch", "engaged"),
        ({"parameters_read": None}, "PX4 parameters", "unknown"),
        ({"parameters_read": False}, "kill switch mapped", "being read"),
        ({"differences": ("COM_LOW_BAT_ACT is 0",)}, "PX4 parameters", "COM_LOW_BAT_ACT is 0"),
        ({"differences": ("RC_MAP_KILL_SW is 0",)}, "kill switch mapped", "RC_MAP_KILL_SW is 0"),
        ({"fence": None}, "geofence", "unknown"),
        ({"fence": Box((-5.0,) * 3, (5.0,) * 3)}, "geofence", "x -5..5, y -5..5, z -5..5"),
        ({"resting": standing(position=np.array([1.9, 0.0, 0.1]))}, "inside geofence", "0.10 m"),
        ({"resting": standing(position=np.array([0.0, 0.0, -0.2]))}, "inside geofence", "2.00 m"),
        ({"host": Host(1e9, True)}, "disk", "1 GB"),
        ({"host": Host(5e10, False)}, "clock", "not synchronised"),
        ({"host": Host(5e10, True, -0.5)}, "clock steps", "500 ms"),
        ({"host": Host(5e10, True, 0.0, ("powersave",))}, "CPU governor", "powersave"),
        ({"preflight": ()}, "pre-arm report", "unknown"),
        (
            {"preflight": (PreflightCheck("speed", "1 m/s", "at most 0.3 m/s", False),)},
            "pre-arm report",
            "speed: 1 m/s (at most 0.3 m/s)",
        ),
    ],
)
def test_each_item_fails_by_its_own_reason(changes, item, value):
    found = failed(good(**changes))
    assert found[item].startswith(value)


def test_a_silent_node_a_node_with_an_error_and_a_servo_error_are_named():
    seen = good()
    seen.nodes["mission"] = NodeReport(9.0, GOOD, "running", {})
    seen.nodes["recorder"] = NodeReport(0.1, BAD, "the disk is full", {})
    seen.nodes["arm_driver"] = hot("alpha_1 error", "overheating")
    found = failed(seen)
    assert found["nodes"] == "mission: silent for 9 s; recorder: the disk is full"
    assert found["recording"] == "the disk is full"
    assert found["servo errors"] == "alpha_1: overheating"


def test_a_vehicle_without_arm_driver_has_no_servo_items():
    seen = good(expected=("mission",), temperatures={})
    assert failed(seen) == {}
    assert "servo temperature" not in {one.name for one in automatic(seen, LIMITS)}


def test_the_own_line_of_the_pre_arm_report_does_not_count():
    assert not failed(
        good(preflight=(*good().preflight, PreflightCheck("checklist", "", "", False)))
    )


def test_what_is_not_wanted_is_left_out():
    limits = replace(LIMITS, radio=False, clock_synchronised=False, performance_governor=False)
    seen = good(radio=None, host=Host(5e10, None, 0.0, ("powersave",)))
    assert failed(seen, limits) == {}
    assert failed(good(host=Host(5e10, True, 0.0, (), 10.0)), replace(LIMITS, rtprio=50.0)) == {
        "real-time priority": "10"
    }


def sample(time, force, attitude=(1.0, 0.0, 0.0, 0.0)):
    zeros = np.zeros(3)
    attitude = np.array(attitude)
    return Sample(time, zeros, attitude, attitude, np.array(force), zeros, STOWED, zeros)


def test_the_vertical_of_a_swapped_imu_is_not_that_of_motion_capture():
    level = Resting.of([sample(0.0, (0.0, 0.0, 9.81))])
    assert (level.tilt, level.gravity_angle, level.force) == pytest.approx((0.0, 0.0, 9.81))
    swapped = Resting.of([sample(0.0, (0.0, 9.81, 0.0))])
    assert swapped.gravity_angle == pytest.approx(math.pi / 2)
    upside_down = Resting.of([sample(0.0, (0.0, 0.0, -9.81))])  # FRD in place of FLU
    assert upside_down.gravity_angle == pytest.approx(math.pi)
    tipped = Resting.of([sample(0.0, (0.0, 0.0, 9.81), (math.sqrt(0.5), math.sqrt(0.5), 0, 0))])
    assert tipped.tilt == pytest.approx(math.pi / 2)


def test_a_stream():
    stream = Stream()
    assert stream.report(0.0) is None
    for i in range(100):
        if i != 50:
            stream.add(0.01 * i)
    report = stream.report(0.99)
    assert report.rate == pytest.approx(98 / 0.99)
    assert report.gap == pytest.approx(0.02) and report.loss == pytest.approx(0.01)
    assert stream.report(1.99).gap == pytest.approx(1.0)
    assert stream.report(1.99).rate < 60.0
    assert stream.report(5.0) is None
    stream.add(0.0)  # a new simulation
    assert stream.report(0.0) is None


@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 3, 7]))
def test_frames_on_the_ticks_of_a_simulation_are_not_lost(seed, lost):
    """120 Hz on ticks of 4 ms come 8 or 12 ms after each other; the driver's clock jitters."""
    noise, stream = np.random.default_rng(seed), Stream()
    stamps = np.floor(np.arange(240) / 120.0 / 0.004) * 0.004
    absent = 20 + 30 * np.arange(lost)  # single ones
    for stamp in np.delete(stamps, absent) + noise.uniform(-2e-4, 2e-4, 240 - lost):
        stream.add(float(stamp))
    assert stream.report(2.0).loss == pytest.approx(lost / 240, abs=5e-4)


PASSING = (
    PreflightCheck("battery", "90 %", "at least 60 %", True),
    PreflightCheck("level", "0", "", True, True),
)
FAILING = (PASSING[0]._replace(passed=False), PASSING[1])


def confirmed_steps():
    return [ConfirmStep("hands_on", "Take it."), ConfirmStep("clear", "Leave.")]


def test_the_order_of_the_list_and_the_permission():
    checklist = Checklist(confirmed_steps())
    assert not checklist.passed and checklist.failing_names[0] == "automatic items"
    checklist.update(Situation(1.0), FAILING, armed=False)
    assert checklist.step is None
    assert checklist.confirm() == (
        False, "refused: no step is waiting; open: battery, hands_on, clear",
    )  # fmt: skip
    checklist.update(Situation(2.0), PASSING, armed=False)
    assert checklist.step.name == "hands_on"
    tilted = (PASSING[0], PASSING[1]._replace(passed=False))
    checklist.update(Situation(3.0), tilted, armed=False)  # in the hands: not judged
    assert checklist.findings == PASSING
    assert checklist.confirm() == (True, "hands_on confirmed")
    assert checklist.step.name == "clear" and not checklist.passed
    assert checklist.confirm()[0]
    checklist.update(Situation(4.0), tilted, armed=False)
    assert not checklist.passed and checklist.failing_names == ["level"]
    checklist.update(Situation(5.0), PASSING, armed=False)
    assert checklist.passed
    checklist.update(Situation(6.0), FAILING, armed=False)  # taken back
    assert not checklist.passed
    checklist.update(Situation(7.0), PASSING, armed=False)
    assert checklist.passed
    checklist.update(Situation(8.0), FAILING, armed=True)  # in flight nothing changes
    assert checklist.passed
    assert checklist.confirm() == (False, "refused: the vehicle is armed")
    assert checklist.repeat() == (False, "refused: the vehicle is armed")


def test_the_last_step_can_be_repeated():
    checklist = Checklist(confirmed_steps())
    assert not checklist.repeat()[0]
    checklist.update(Situation(1.0), PASSING, armed=False)
    checklist.confirm()
    assert checklist.repeat() == (True, "clear begins again")
    checklist.confirm()
    assert checklist.passed
    assert checklist.repeat() == (True, "clear begins again")
    assert not checklist.passed


@settings(max_examples=60, deadline=None)
@given(
    acts=st.lists(
        st.sampled_from(["confirm", "repeat", "pass", "fail", "armed", "disarmed"]), max_size=40
    )
)
def test_no_order_of_events_gives_a_permission_with_an_open_item(acts):
    checklist, armed = Checklist(confirmed_steps()), False
    findings = FAILING
    for time, act in enumerate(acts):
        if act in ("confirm", "repeat"):
            getattr(checklist, act)()
        elif act in ("pass", "fail"):
            findings = PASSING if act == "pass" else FAILING
        else:
            armed = act == "armed"
        before = checklist.passed
        checklist.update(Situation(float(time)), findings, armed)
        done = all(one.state is StepState.PASSED for one in checklist.steps)
        if armed:
            assert checklist.passed is before
        else:
            assert checklist.passed is (findings is PASSING and done)
        assert checklist.passed is (not checklist.failing_names)


def test_the_record_has_every_step_with_time_and_confirmation():
    checklist = Checklist(confirmed_steps())
    for time in (1.0, 2.0):
        checklist.update(Situation(time), PASSING, armed=False)
        checklist.confirm()
    content = json.loads(json.dumps(record(checklist, LIMITS, 1e9)))
    assert content["passed"]
    items = {one["name"]: one for one in content["items"]}
    assert items["clear"]["time"] == "2001-09-09T01:46:42.000+00:00"
    assert items["clear"]["confirmed_by_person"] and items["clear"]["tries"] == 1
    assert [one["name"] for one in content["events"]][:3] == ["battery", "level", "hands_on"]
    assert content["limits"]["tilt"] == LIMITS.tilt


def test_the_magnet_by_its_driver_or_by_the_person():
    step = MagnetStep(True, LIMITS)
    step.begin(10.0)
    assert step.confirm(10.0).startswith("magnet_on passes by what the sensors see")
    step.update(Situation(10.1, magnet=None))
    assert step.needs == CONFIRM and step.confirm(10.2) == ""
    assert step.state is StepState.PASSED and step.confirmed
    step.begin(20.0)
    step.update(Situation(20.1, magnet=False))
    assert step.state is StepState.ACTIVE and step.confirm(20.1)
    step.update(Situation(23.5, magnet=False))
    assert step.state is StepState.FAILED and step.value == "reported off 3.5 s after the command"
    step.update(Situation(24.0, magnet=True))
    assert step.state is StepState.PASSED


def test_the_kill_switch_is_seen_or_confirmed():
    step = KillStep(LIMITS)
    step.begin(0.0)
    step.update(Situation(0.1, killed=False))
    for time in (1.0, 1.2, 1.4):
        step.update(Situation(time, killed=True))
    assert step.confirm(1.4) == "the kill switch is seen engaged: release it"
    step.update(Situation(1.5, killed=False))
    assert step.state is StepState.PASSED and step.value == "engaged for 0.4 s, released"
    step.begin(2.0)
    step.update(Situation(2.1, killed=True))
    step.update(Situation(2.2, killed=False))
    assert step.state is StepState.ACTIVE and step.seen == "engaged for 0.0 s only"
    step.begin(3.0)
    step.update(Situation(3.1))
    assert step.seen == "not reported: confirm" and step.confirm(3.2) == ""


def test_the_steps_of_a_vehicle():
    names = [one.name for one in guided(JOINTS, LIMITS)]
    assert names == [
        *("hands_on", "tilt_roll", "tilt_pitch", "yaw_turn", "move_forward", "lift"),
        *("joint:alpha_1", "joint:alpha_2", "magnet_on", "magnet_off", "kill_switch", "clear"),
    ]
    without = [one.name for one in guided((), LIMITS, magnet=False)]
    assert without == [one for one in names if not one.startswith(("joint", "magnet"))]
    steps = {one.name: one for one in guided(JOINTS, LIMITS)}
    assert [one for one in names if steps[one].commands] == ["tilt_roll", "tilt_pitch", "yaw_turn"]
    assert [one for one in names if steps[one].arm_released] == ["joint:alpha_1", "joint:alpha_2"]


def test_the_computer_is_read(tmp_path):
    host = HostReader(tmp_path / "not" / "there").read()
    assert host.disk > 0.0 and abs(host.jump) < 1.0 and host.rtprio >= 0.0
    assert host.synchronised in (None, True, False)
    for core, governor in enumerate(("performance", "powersave")):
        file = tmp_path / f"cpu{core}" / "cpufreq" / "scaling_governor"
        file.parent.mkdir(parents=True)
        file.write_text(f"{governor}\n")
    assert governors(tmp_path) == ("performance", "powersave")


def test_the_message_and_back():
    items = [
        PreflightCheck("battery", "40 %", "at least 60 %", False, kind="automatic"),
        PreflightCheck(
            "clear", "confirmed", "confirmed", True, kind="guided", time="12.5", confirmed=True
        ),
        PreflightCheck("lift", "", "at least 0.2 m", None, kind="guided"),
    ]
    state = ChecklistState(False, "battery; lift", "lift", "motion", "Lift it.", "up", True, True)
    message = checklist_message(4_000_000_000, state, items)
    assert ChecklistState.from_message(message) == (4_000_000_000, state)
    assert read_checks(message) == items
    assert state.summary == "open: battery; lift"
    assert ChecklistState(True).summary == "all items passed"


def test_the_radio_in_words():
    assert RadioState(True, "yes").summary == "received; kill switch engaged"
    assert RadioState(False, "").summary == "unknown"
    assert RadioState.from_message(RadioState(True, "no").to_message(1)) == (
        1, RadioState(True, "no"),
    )  # fmt: skip
