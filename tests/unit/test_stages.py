"""The stages of a control tick by themselves."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from uam_control.estimation import EstimatorParameters
from uam_control.mission import Mission, load_scenario
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.profiles.profile import load_profile
from uam_control.setpoints.targets import AttitudeTarget, VisionPose
from uam_control.stages.autopilot_port import AutopilotReport
from uam_control.stages.estimator_stage import EstimatorStage
from uam_control.stages.law_stages import LawStage
from uam_control.stages.mission_stage import MissionStage
from uam_control.stages.supervisor_inputs import (
    BIAS,
    GAINS,
    JOINTS,
    LIFT,
    MOCAP,
    PAYLOAD,
    SupervisorInputs,
)
from uam_control.stages.tick_stamps import Timing
from uam_control.stamps import SECOND, nanoseconds
from uam_control.supervision.inputs import SUBSYSTEMS
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.joined import JoinedAutopilot
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay

MS = 1_000_000  # [ns]
PERIOD = 4 * MS
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
REST, WEIGHT = np.zeros(3), np.array([0.0, 0.0, 9.81])


def test_stamps_are_whole_microseconds_and_exact_seconds():
    assert nanoseconds(3 * 0.004) == 12_000_000  # 3 * 0.004 is not 0.012
    assert 12_000_000 / SECOND == 0.012


def test_time_steps_are_one_period_after_a_long_gap_or_a_step_back():
    stage = LawStage(SimpleNamespace(update=lambda dt: dt), Timing())
    steps = [stage.update(stamp * MS) for stamp in (100, 104, 112, 152, 196, 100, 104)]
    assert steps == [0.004, 0.004, 0.008, 0.04, 0.004, 0.004, 0.004]


def test_the_estimator_refuses_a_stamp_that_does_not_follow():
    stage = EstimatorStage(EstimatorParameters(), joints=2, period=0.004)
    assert stage.imu(0, REST, WEIGHT) is None  # no pose and no joints yet
    stage.mocap(0, REST, LEVEL)
    stage.joints(0, np.zeros(2), np.zeros(2))
    assert stage.imu(PERIOD, REST, WEIGHT).shape == (3, 8)
    assert stage.imu(PERIOD, REST, WEIGHT) is None  # repeated
    assert (stage.stamp, stage.ticks.repeated) == (PERIOD, 1)
    with pytest.raises(ValueError, match="IMU stamp 0 ns does not follow 4000000 ns"):
        stage.imu(0, REST, WEIGHT)


@pytest.mark.parametrize("force", [np.nan, 1e9])
def test_a_diverged_estimate_is_held_back_for_a_second_and_begins_anew(force):
    stage = EstimatorStage(EstimatorParameters(), joints=2, period=0.004)
    assert not stage.held_back
    held = []
    for stamp in range(0, 3000 * MS, PERIOD):
        stage.joints(stamp, np.zeros(2), np.zeros(2))
        stage.mocap(stamp, 1e-12 * stamp * np.ones(3), LEVEL)
        now = WEIGHT if stamp != 500 * MS else np.array([0.0, 0.0, force])
        state = stage.imu(stamp, REST, now)
        if state is None:
            held.append(stamp)
            assert stage.held_back
        else:
            assert not stage.held_back
            np.testing.assert_allclose(state[:2], 0.0, atol=0.1)
    assert stage.diverged == 1
    assert held == list(range(500 * MS, 1500 * MS, PERIOD))


def test_the_bias_of_the_imu_is_found_in_the_body_frame_and_due_every_20_ms():
    stage = EstimatorStage(EstimatorParameters(), joints=2, period=0.004)
    stage.joints(0, np.zeros(2), np.zeros(2))
    nose_left = np.array([0.5**0.5, 0.0, 0.0, 0.5**0.5])  # yaw of 90 deg
    bias, due = np.array([0.4, 0.0, 0.0]), []
    for stamp in range(0, 3000 * MS, PERIOD):
        stage.mocap(stamp, 1e-9 * stamp * np.ones(3), nose_left)  # no pose repeats: 1 m/s
        stage.imu(stamp, REST, WEIGHT + bias)
        if stage.bias_due:
            due.append(stamp)
    gyro, accelerometer = stage.estimator.imu_bias
    np.testing.assert_allclose(accelerometer, bias, atol=0.01)
    np.testing.assert_allclose(gyro, 0.0, atol=1e-6)
    assert set(np.diff(due)) == {20 * MS}
    stage.estimator.set_parameters(EstimatorParameters(position_bandwidth=30.0))
    for stamp in range(3000 * MS, 3100 * MS, PERIOD):
        stage.imu(stamp, REST, WEIGHT + bias)
        assert not stage.bias_due  # noise would cover it


def test_the_newest_message_is_read_every_20_ms():
    inputs, read = SupervisorInputs(0.004), []
    for stamp in range(0, 48 * MS, PERIOD):
        inputs.keep("mocap", read.append, (stamp // MS,))
        inputs.tick(stamp)
    assert read == [0, 20, 40]


def test_a_pose_from_the_future_does_not_count_as_young():
    inputs = SupervisorInputs(0.004)
    for stamp in range(0, 600 * MS, PERIOD):
        ahead = 0 if stamp < 200 * MS else 300 * MS
        inputs.keep("mocap", inputs.mocap, (stamp + ahead, np.full(3, 1e-9 * stamp), LEVEL))
        readings = inputs.tick(stamp)
    assert readings.mocap_age == pytest.approx(0.4, abs=0.03)


def test_an_answer_to_a_tick_counts_from_the_next_tick_on():
    inputs, read = SupervisorInputs(0.004), []
    inputs.tick(0)
    inputs.keep("gains", read.append, ("of 20 ms",), answers=20 * MS)
    inputs.tick(20 * MS)
    assert read == []
    inputs.tick(40 * MS)
    assert read == ["of 20 ms"]


def test_an_answer_that_is_early_does_not_replace_the_one_before_it():
    """A mission one tick behind its controllers: gains of the reading's tick are there already."""
    inputs, read = SupervisorInputs(0.004), []
    for stamp in range(0, 101 * MS, 20 * MS):
        inputs.keep("gains", read.append, (stamp // MS,), answers=stamp)
        inputs.tick(stamp)
    assert read == [0, 20, 40, 60, 80]


def mission_stage():
    parameters = load_profile("s500").sets["mission"]
    return MissionStage(Mission(load_scenario("hover"), parameters), Timing())


def test_messages_of_stages_are_read_as_those_of_other_processes():
    names = ("K0", "other"), ("zeta",), ("K1",)
    put, kept = SupervisorInputs(0.004), SupervisorInputs(0.004)
    put.share(2, names)
    for stamp in range(0, 200 * MS, 4 * MS):
        now, way = stamp / SECOND, np.array([1e-9 * stamp, 0.0, 1.0])
        effort, gains = np.array([0.1, now]), np.array([now, 9.0])
        put.put(MOCAP, stamp, way, LEVEL)
        kept.keep("mocap", kept.mocap, (stamp, way, LEVEL))
        put.put(JOINTS, stamp, effort)
        kept.keep("joints", kept.inputs.joints, (now, effort))
        put.put(PAYLOAD, stamp, 2.0 * way)
        kept.keep("payload", kept.payload, (stamp, 2.0 * way, LEVEL))
        put.put(BIAS, stamp, 0.1 * way)
        kept.keep("bias", kept.inputs.accelerometer_bias, (now, 0.1 * way))
        put.put(LIFT, stamp, (20.0 + now, 0.5 + now))
        kept.keep("lift", kept.inputs.lift, (20.0 + now, 0.5 + now))
        for i, own in enumerate(names):
            given = gains[: len(own)]
            put.put(GAINS + i, stamp, given)
            kept.keep(SUBSYSTEMS[i], kept.inputs.gains, (now, SUBSYSTEMS[i], own, given))
        for one, other in zip(put.tick(stamp).arrays, kept.tick(stamp).arrays, strict=True):
            np.testing.assert_array_equal(one, other)
        read = put.readings
        np.testing.assert_array_equal(read.payload_position, 2.0 * read.mocap_position)
    assert put.settled and not kept.settled


def test_the_mission_makes_the_reference_of_the_next_tick():
    stage, state = mission_stage(), np.zeros((3, 8))
    stage.begin(0, state)
    assert stage.anew  # the first one has to be made
    stage.advance(0, state)
    assert stage.ahead == PERIOD
    stage.begin(PERIOD, state)
    assert not stage.anew
    stage.advance(PERIOD, state)
    stage.begin(12 * PERIOD, state)  # after a long gap as well
    assert stage.anew and stage.ahead == 12 * PERIOD


@pytest.mark.parametrize("step", [0.8, 1.2, 2.0, 10.0])
def test_each_tick_has_one_reference_carried_to_its_stamp(step):
    stage, state = mission_stage(), np.zeros((3, 8))
    stage.begin(0, state)
    stage.advance(0, state)
    reference = stage.output.reference
    reference[:] = np.arange(24.0).reshape(3, 8)
    stamp = round(step * PERIOD)
    stage.begin(stamp, state)
    assert not stage.anew and stage.ahead == PERIOD
    late = (stamp - PERIOD) * 1e-9
    position, velocity, acceleration = reference
    expected = position + late * velocity + late**2 / 2 * acceleration
    np.testing.assert_allclose(stage.reference[0], expected, rtol=1e-15)
    np.testing.assert_allclose(stage.reference[1], velocity + late * acceleration, rtol=1e-15)
    np.testing.assert_array_equal(stage.reference[2], acceleration)
    stage.advance(stamp, state)
    assert stage.ahead == stamp + PERIOD


def test_a_report_of_the_autopilot_counts_from_the_next_tick_on():
    stage, state = mission_stage(), np.zeros((3, 8))
    known = {"armed_since": 0, "round_trip": 0.01, "loop_delay": 0.02}
    held = Phase.RELEASED, (), "the pilot, in HOLD"
    report = AutopilotReport(True, Mode.HOLD, True, *held, **known)
    stage.autopilot(0, report)
    stage.begin(0, state)
    assert np.isnan(stage.inputs.readings.autopilot_age)
    stage.begin(PERIOD, state)
    assert stage.inputs.readings.autopilot_age == 0.004
    assert stage.inputs.readings.round_trip == 0.01
    assert stage.inputs.readings.loop_delay == 0.02
    stage.advance(PERIOD, state)
    checks = {check.name: check for check in stage.mission.preflight()}
    assert not checks["control"].passed and checks["control"].value == "the pilot, in HOLD"


def test_a_new_bridge_that_has_not_heard_the_autopilot_says_nothing_of_its_motors():
    stage, state = mission_stage(), np.zeros((3, 8))
    armed = AutopilotReport(True, Mode.OFFBOARD, True, Phase.FLYING, (), armed_since=0)
    stage.autopilot(0, armed)
    stage.begin(PERIOD, state)
    stage.advance(PERIOD, state)
    unheard = AutopilotReport(False, Mode.UNKNOWN, False, Phase.WAITING, ())
    for report, expected in ((unheard, True), (armed._replace(armed=False), False)):
        stage.autopilot(PERIOD, report)
        stage.begin(2 * PERIOD, state)
        stage.advance(2 * PERIOD, state)
        assert stage.mission._seen.armed is expected


class Joined:
    """A joined autopilot at rest, tick by tick, poses coming in."""

    def __init__(self, network=None):
        self.sequence = OffboardSequence()
        self.port = JoinedAutopilot(Autopilot(), self.sequence, network)
        self.sequence.set_desired(True)
        self.ticks = 0

    def run(self, seconds):
        for _ in range(round(seconds / 0.004)):
            time, port = 0.004 * self.ticks, self.port
            port.time = time
            port.poll(time)
            port.tick(time)
            if self.ticks % 5 == 0:
                position = 1e-6 * self.ticks * np.ones(3)
                port.send_vision(VisionPose(time, position, LEVEL, 0.01, 0.01))
            port.send_setpoint(AttitudeTarget.of_rates(REST, 0.0), time)
            port.update(time, REST, WEIGHT)
            self.ticks += 1


def test_what_the_joined_autopilot_does_is_known_a_tick_later():
    rig = Joined()
    while not rig.port.autopilot.commander.armed:
        rig.run(0.004)
    assert not rig.port.armed and rig.sequence.phase is Phase.ARMING
    rig.run(0.004)
    assert rig.port.armed and rig.port.mode is Mode.OFFBOARD
    assert rig.port.armed_since == pytest.approx(0.004 * (rig.ticks - 1))
    assert rig.sequence.phase is Phase.FLYING


def test_messages_of_the_joined_autopilot_are_late_in_order():
    rig = Joined()
    rig.run(2.0)
    assert rig.port.round_trip == pytest.approx(0.004)
    late = iter([0.012, 0.0, 0.004] + 10 * [0.0])
    rig.port.link.late_to, rig.port.link.late_from = lambda: next(late, 0.0), lambda: 0.02
    seen = []
    rig.port.autopilot.target = lambda time, target: seen.append((round(time, 3), target.thrust))
    begin = rig.ticks
    for i in range(5):
        time = 0.004 * (begin + i)
        rig.port.time = time
        if i:
            late_to, rig.port.link.late_to = rig.port.link.late_to, lambda: 0.0
            rig.port.poll(time)  # the round trip takes a value of its own
            rig.port.link.late_to = late_to
        else:
            rig.port._now = time
        rig.port.send_setpoint(AttitudeTarget.of_rates(REST, 0.1 * i), time)
    # 12 ms, 0 ms and 4 ms: the second and the third wait for the first
    start = round(0.004 * begin, 3)
    arrived = [(round(at - start, 3), round(thrust, 1)) for at, thrust in seen]
    assert arrived == [(0.012, 0.0), (0.012, 0.1), (0.012, 0.2), (0.012, 0.3), (0.016, 0.4)]
    assert rig.port.round_trip == pytest.approx(0.024)


def test_compiled_steps_of_the_joined_autopilot_are_late_as_its_methods():
    rigs = [Joined(SetpointDelay(0.003, 0.004, 0.03, 5)) for _ in range(2)]
    for rig in rigs:
        rig.run(2.0)
    assert all(rig.port.armed and rig.port.steps.ready(rig.port.arrays, 1.996) for rig in rigs)
    seen = [[], []]
    for tick in range(rigs[0].ticks, rigs[0].ticks + 200):
        time, rates = 0.004 * tick, np.array([0.01, 0.02, 0.03]) * tick
        for i, (rig, found) in enumerate(zip(rigs, seen, strict=True)):
            port = rig.port
            port.time = time
            port.network.draw()
            pose = 1e-3 * tick * np.ones(3)
            target = AttitudeTarget.of_rates(rates * [1, -1, -1], 1e-3 * tick)
            if i == 0:
                port.poll(time)
                port.send_vision(VisionPose(time, pose, LEVEL, 0.01, 0.01))
                port.send_setpoint(target, time)
            else:
                port.steps.poll(port.arrays, time)
                port.steps.send_vision(port.arrays, time, np.array([*pose, *LEVEL]))
                port.steps.send_setpoint(port.arrays, time, rates, target.thrust)
            port.update(time, REST, WEIGHT)
            newest = port.autopilot.estimator.arrays.estimate
            found.append((*port.arrays.autopilot.setpoint, port.round_trip, *newest))
    assert seen[0] == seen[1]
    sent = [pytest.approx(1e-3 * (500 + tick)) for tick in range(200)]
    late = [row for row, thrust in zip(seen[0], sent, strict=True) if row[3] != thrust]
    assert len(late) > 150 and len({row[4] for row in seen[0]}) > 100  # they were late


def test_late_reports_of_the_joined_autopilot():
    rig = Joined()
    rig.port.link.late_from = lambda: 0.02
    while not rig.port.autopilot.commander.armed:
        rig.run(0.004)
    rig.run(0.02)
    assert not rig.port.armed
    rig.run(0.004)
    assert rig.port.armed


def test_heartbeats_that_are_lost_are_missed_after_3_s_and_a_change_is_reported_by_the_next():
    rig = Joined()
    rig.run(2.0)
    assert rig.port.connected(2.0) and rig.port.armed
    rig.port.link.receives = lambda: False
    rig.port.autopilot.commander.armed = False
    rig.run(1.9)
    assert rig.port.armed and rig.port.connected(0.004 * rig.ticks)
    rig.run(1.2)
    assert not rig.port.connected(0.004 * rig.ticks)
    rig.port.link.receives = lambda: True
    rig.run(1.1)
    assert not rig.port.armed and rig.port.connected(0.004 * rig.ticks)


def test_nothing_passes_a_cut():
    rig = Joined()
    rig.port.link.passes = lambda: False
    rig.run(2.5)
    autopilot = rig.port.autopilot
    assert not autopilot.commander.streaming(2.5) and not autopilot.commander.armed
    assert rig.sequence.phase is Phase.OFFBOARD
