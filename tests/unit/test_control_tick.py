"""One control tick: order of its stages, ticks without samples, gaps, reports between stages."""

from __future__ import annotations

import math

import numpy as np
import pytest
from control_rig import PERIOD, Rig

from uam_control.coordinates import ARM
from uam_control.maths.kept_tuple import compiled_hook, table
from uam_control.stages.control_tick import STAGES
from uam_control.stages.step import DONE, chain
from uam_control.stamps import SECOND


def test_the_stages_are_those_of_the_block_diagram():
    assert [stage.name for stage in STAGES] == [
        "listeners of the sensors",
        "estimator",
        "mission",
        "position law",
        "attitude law",
        "hand",
        "arm law",
        "bridge",
        "next reference",
    ]


def test_a_law_of_the_whole_body_is_one_stage():
    rig = Rig("whole_body_l1")
    names = [stage.name for stage in rig.control.stages]
    assert names[2:5] == ["mission", "whole body", "bridge"]
    rig.run(3.0)
    signals, laws = rig.signals, rig.control.laws.values()
    assert signals.flying and signals.tau_p[2] > 0.0
    outputs = signals.tau_p, signals.tau_q, signals.tau_alpha
    for output, law in zip(outputs, laws, strict=True):
        assert output is law.controller.arrays.all.tau
        assert law.controller.adaptation.any(), "the rates stay, against what is predicted"
    desired = rig.control.position.controller.attitude_reference
    np.testing.assert_array_equal(signals.attitude_reference, desired)


@pytest.mark.long  # two large functions are compiled for it
def test_the_compiled_step_of_the_whole_body_does_what_the_stage_does():
    outputs = []
    for compiled in (False, True):
        rig = Rig("whole_body_l1")
        rig.run(3.0)
        control = rig.control
        stage = next(one for one in control.stages if one.name == "whole body")
        if compiled:
            hook = compiled_hook(*stage.step(control))
            assert chain(table([hook])) == DONE
        else:
            assert stage.run(control)
        s, laws = control.signals, control.laws.values()
        gains = [one.controller.law.adaptation.copy() for one in laws]
        outputs.append([s.tau_p, s.tau_q, s.tau_alpha, s.attitude_reference, *gains])
    for by_python, by_step in zip(*outputs, strict=True):
        np.testing.assert_array_equal(by_python, by_step)


def test_a_further_stage_comes_before_the_one_named():
    rig, seen = Rig(), []
    rig.control.insert("bridge", "probe", lambda tick: not seen.append(tick.signals.stamp))
    assert [stage.name for stage in rig.control.stages][6:9] == ["arm law", "probe", "bridge"]
    assert len(STAGES) == 9
    rig.tick()
    assert seen == [0]
    with pytest.raises(ValueError, match="nothing"):
        rig.control.insert("nothing", "probe", lambda tick: True)


def test_ticks_before_every_sensor_has_delivered_are_blind():
    rig = Rig()
    assert not rig.tick(joints=False)
    assert not rig.tick(mocap=False, joints=False)
    assert rig.signals.stamp == -1 and rig.port.setpoints == []
    assert rig.tick()
    assert rig.signals.stamp == 2 * PERIOD


def test_a_blind_tick_leaves_the_signals_and_takes_the_samples():
    rig = Rig()
    rig.tick()
    kept = rig.signals.state.copy(), rig.signals.stamp, len(rig.port.setpoints)
    assert not rig.tick(imu=False)
    assert np.array_equal(rig.signals.state, kept[0])
    assert (rig.signals.stamp, len(rig.port.setpoints)) == kept[1:]
    rig.run(0.02)
    assert rig.control.mission.inputs.readings.mocap_age < 0.02


def test_after_a_gap_the_reference_is_that_of_the_tick():
    rig = Rig()
    rig.run(2.5)
    mission = rig.control.mission
    assert rig.signals.flying and mission.ahead == rig.stamp
    for _ in range(5):
        rig.tick(imu=False)
    assert rig.tick()
    takeoff = mission.ahead - PERIOD - round(rig.signals.time * 1e9)
    assert rig.signals.stamp == rig.stamp - PERIOD
    assert takeoff == pytest.approx(mission.mission.changes[0].stamp * 1e9, abs=1e3)
    assert mission.inputs.readings.missed_ticks == 5.0


def test_on_the_ground_only_the_arm_has_a_reference_and_torques():
    rig = Rig()
    start = rig.angles
    rig.angles = start + 0.01
    rig.tick()
    s = rig.signals
    assert not s.flying and s.setpoint.thrust == 0.0
    assert np.array_equal(s.reference[0, ARM], start)
    assert not s.reference[:, : ARM.start].any() and not s.attitude_reference.any()
    assert not s.tau_p.any() and not s.tau_q.any() and s.tau_alpha.any()


def test_it_takes_off_by_the_autopilots_report_of_the_tick_before():
    rig = Rig()
    while not rig.port.armed:
        rig.tick()
    armed = rig.signals.stamp
    assert rig.port.armed_since == armed * 1e-9
    delay = rig.control.mission.mission._parameters.takeoff_delay
    while not rig.signals.flying:
        rig.tick()
    assert rig.signals.stamp * 1e-9 == pytest.approx(armed * 1e-9 + max(delay, 0.008), abs=1e-9)
    assert rig.signals.tau_p[2] > 0.0 and rig.signals.setpoint.thrust > 0.0


def test_poses_go_to_the_autopilot_at_most_every_20_ms():
    rig = Rig()
    rig.run(1.0)
    assert np.diff(rig.port.poses) == pytest.approx(np.full(49, 0.02))


def test_a_frozen_tracker_is_sent_until_armed_and_not_in_flight():
    rig = Rig()
    rig.run(0.2, noise=0.0)
    assert len(rig.port.poses) == 10
    rig.port.armed = True
    rig.run(0.2, noise=0.0)
    assert len(rig.port.poses) == 10


def test_the_supervisor_sees_gains_sensors_and_the_link():
    rig = Rig()
    rig.run(0.1)
    readings = rig.control.mission.inputs.readings
    assert readings.round_trip == 0.01 and readings.autopilot_age < 0.21
    assert readings.controller_age <= 0.04 and readings.joint_age <= 0.02
    assert readings.gains[2] == pytest.approx(max_gain(rig), rel=0.5)
    assert not math.isnan(readings.mocap_age)


def max_gain(rig):
    law = rig.control.laws["arm"].controller
    watched = [i for i, name in enumerate(law.names) if name.startswith(("K", "zeta"))]
    return np.abs(law.adaptation[watched]).max()


def test_setpoints_in_flight_are_new_at_their_rate_and_are_sent_at_every_tick():
    rig = Rig(setpoint_rate=25.0)
    rig.run(3.0)
    assert rig.signals.flying
    rates = [tuple(setpoint.rates) for _, setpoint in rig.port.setpoints[-30:]]
    new = [i for i in range(1, 30) if rates[i] != rates[i - 1]]
    assert [b - a for a, b in zip(new, new[1:], strict=False)] == [10] * (len(new) - 1)
    assert len(new) in (2, 3)
    rig.run(0.1, imu=False)
    rig.control.bridge.without(rig.stamp)  # the level hold is not held back
    assert tuple(rig.port.setpoints[-1][1].rates) != rates[-1]


def test_in_the_hands_of_a_person_the_commands_are_computed_and_not_sent():
    rig = Rig()
    bridge = rig.control.bridge
    state = np.zeros((3, 8))
    inputs = state, True, np.array([0.0, 0.0, 21.6]), np.array([-0.2, 0.0, 0.0])
    desired = np.zeros((3, 3)), np.zeros((3, 3))
    for hands, armed, sent_thrust in (
        (True, False, False),
        (True, True, True),
        (False, False, True),
    ):
        rig.stamp += PERIOD
        bridge.hands, rig.port.armed = hands, armed
        bridge.hear(rig.stamp)
        setpoint = bridge.tick(rig.stamp, *inputs, *desired)
        assert setpoint.thrust > 0.0 and setpoint.rates[0] < 0.0
        assert (rig.port.setpoints[-1][1].thrust > 0.0) is sent_thrust


def test_a_new_bridge_obeys_no_resume_of_before():
    bridge, asked = Rig().control.bridge, []
    bridge.sequence.regain = asked.append
    for at, regains in ((1, 1), (2, 1), (3, 2)):
        bridge.mission(at * SECOND, False, False, regains)
        bridge.hear(at * SECOND + PERIOD * 5)
    assert asked == [3.0]
