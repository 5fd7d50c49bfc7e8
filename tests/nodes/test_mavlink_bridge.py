"""The bridge node over real ROS and real UDP, with the autopilot's objects on the other end."""

import math
import time

import numpy as np
import pytest
from bridge_rig import MODULE, PERIOD, WEIGHT
from free_port import free_port
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import read_imu
from uam_msgs_py.messages.parameter_comparison import ParameterComparison
from uam_msgs_py.messages.serialized import Serialized, Template
from uam_msgs_py.messages.status import AutopilotState, MissionStatus
from uam_sim_bridge.mavlink.protocol.wire import mavlink2


def test_alone_it_waits_and_stops(start):
    node = start(MODULE, "--ros-args", "-p", f"local_port:={free_port()}")
    node.until_logged(
        "waiting for /vrpn_mocap/uam/pose, /uam/state, /uam/position/command, /uam/attitude/command"
    )
    assert node.interrupt(times=3) == 0
    assert "Traceback" not in node.output


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["-p", "rate_p:=[0.0, 0.1, 0.1]"], "rate_p"),
        (["-p", "clock:=sundial"], "clock: 'sundial' is not one of"),
        (["-p", "local_port:=99999"], "local_port"),
        (["-p", "autopilot:=pigeon"], "allowed: udp:HOST:PORT"),
        (["-p", "autopilot:=serial:/dev/nothing:57600"], "does not exist"),
        (["-p", "autopilot:=14550"], "autopilot: 14550 is no text"),
        (["-p", "autopilot:=udp:127.0.0.1:9", "-p", "gcs:=tcp:localhost:5760"], "udp:HOST:PORT"),
        (["-p", "required_parameters:=boat"], "no px4/boat.yaml"),
        (["-p", "signing_key:=no/such/file"], "signing key: not 64 hex digits"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(start, arguments, complaint):
    node = start(MODULE, "--ros-args", *arguments)
    assert node.process.wait(60) == 2
    errors = [line for line in node.output.splitlines() if line.startswith("mavlink_bridge: ")]
    assert len(errors) == 1 and complaint in errors[0] and "Traceback" not in node.output


def test_the_autopilots_imu_is_published_before_and_with_the_ticks(make_rig, probe):
    clock, samples = probe.publisher(topics.CLOCK), probe.collect(topics.IMU)
    rig = make_rig("-p", "imu_source:=autopilot", "-p", "imu_clock:=topic")
    probe.until_connected("mavlink_bridge", [clock], [topics.IMU])
    writer = Template(Clock())

    def served():
        clock.publish(writer.stamped(round(rig.body.time * 1e9) + 1000 * PERIOD))
        rig.autopilot_tick()
        rig.count += 1
        if len(samples) <= 20:
            return False
        age = round(rig.body.time * 1e9) + 1000 * PERIOD - read_imu(samples[-1])[0]
        # the clock of the test stands still between two ticks: TIMESYNC is right to some of them
        return abs(age) <= 5 * PERIOD

    probe.until(served, "samples of now before the first tick")
    assert Serialized(Imu, samples[-1]).layout.frame == "base_link"
    _, gyro, force = read_imu(samples[-1])
    np.testing.assert_allclose(gyro, rig.body.gyro, atol=1e-6)
    np.testing.assert_allclose(force, rig.body.accel, atol=1e-5)
    before = len(samples)
    for _ in range(20):
        rig.tick()
    probe.until(lambda: len(samples) >= before + 20, "samples with the ticks")
    rig.received.clear()

    def requested():
        """Only /clock goes on, as after a reboot: samples need requests, ticks need samples."""
        clock.publish(writer.stamped(round(rig.body.time * 1e9) + 1000 * PERIOD))
        rig.autopilot_tick()
        return {"HEARTBEAT", "TIMESYNC"} <= rig.kinds()

    probe.until(requested, "requests without ticks")


def test_from_the_ground_to_hover_and_back(make_rig):
    rig = make_rig()
    rates, thrust = rig.tick()
    assert np.all(rates == 0.0) and thrust == 0.0
    rig.fly()
    states = [AutopilotState.from_message(m)[1] for m in rig.states]
    assert not states[0].armed and states[-1].armed and states[-1].mode == "OFFBOARD"
    since = states[-1].armed_since
    assert since % PERIOD == 0 and 1.0e9 < since < 2.5e9
    rates, thrust = rig.tick((0, 0, WEIGHT), (0.1, 0.0, 0.0))
    assert thrust == pytest.approx(WEIGHT / 41.36, rel=1e-6)
    assert rates == pytest.approx([0.1 / (5.00105 * 0.15), 0, 0], rel=1e-3, abs=1e-9)
    sent = [m for m in rig.received if m.get_type() == "SET_ATTITUDE_TARGET"][-1]
    assert sent.type_mask == 128
    assert (sent.body_roll_rate, sent.body_pitch_rate) == pytest.approx((rates[0], 0.0), rel=1e-5)
    assert sent.thrust == pytest.approx(thrust)
    assert {"HEARTBEAT", "VISION_POSITION_ESTIMATE", "COMMAND_LONG", "PARAM_REQUEST_READ"} <= (
        rig.kinds()
    )
    # landed: idle commands, then disarm
    rig.body.position[2] = 0.0
    rig.body.velocity[:] = rig.body.gyro[:] = 0.0
    for _ in range(400):
        rig.tick()
    rig.publish(topics.ARMING, Bool(data=False))
    for _ in range(300):
        rig.tick()
        if not rig.autopilot.status.armed:
            break
    assert not rig.autopilot.status.armed


def test_mapping_parameters_of_the_autopilot_are_compared(make_rig):
    rig = make_rig()
    rig.autopilot.set_parameter("MC_ROLLRATE_P", 0.3)
    for _ in range(100):
        rig.tick()
    rig.node.until_logged("MC_ROLLRATE_P is 0.3 on the autopilot, the bridge assumes 0.15")


def test_required_parameters_are_compared_and_reported(make_rig, probe, tmp_path):
    rules = tmp_path / "mine.yaml"
    rules.write_text(
        "needed:\n  COM_LOW_BAT_ACT: {one_of: [2, 3], why: the battery}\n"
        "  COM_OF_LOSS_T: {least: 0.5, most: 1.0, why: the stream}\n"
    )
    rig = make_rig("-p", f"required_parameters:={rules}")

    def reported():
        rig.tick()
        found = ParameterComparison.from_message(rig.states[-1]) if rig.states else None
        return found is not None and found.complete

    probe.until(reported, "a complete comparison")
    found = ParameterComparison.from_message(rig.states[-1])
    assert [(one.name, one.found, one.required) for one in found.differences] == [
        ("COM_LOW_BAT_ACT", 0.0, "2 or 3")
    ]
    assert found.read == found.required == 2 and not found.passed
    assert "PARAM_SET" not in rig.kinds()
    rig.node.until_logged("COM_LOW_BAT_ACT is 0, 2 or 3 required: the battery")


def test_the_thrust_factor_is_identified_published_and_constant_while_the_magnet_is_on(
    make_rig, probe
):
    """The vehicle hovers with the thrust of its weight; the bridge assumes a lower mass."""
    status = probe.publisher(topics.MISSION_STATUS)
    factors = probe.collect(topics.THRUST)
    rig = make_rig("-p", "identification_mass:=1.9", "-p", "factor_slew:=0.5")
    probe.until_connected("mavlink_bridge", [status], [topics.THRUST])

    def factor():
        return Serialized(JointState, factors[-1]).numbers("position")[0]

    rig.fly()
    assert factor() == 1.0
    for _ in range(300):
        _, thrust = rig.tick((0, 0, WEIGHT))
    assert 0.86 < factor() < 0.97
    assert thrust * 41.36 == pytest.approx(WEIGHT / factor(), rel=0.01)  # it is applied
    stamp = (rig.count - 1) * PERIOD
    status.publish(MissionStatus("carry", 1.0, magnet=True).to_message(stamp))
    time.sleep(0.2)  # no input of the join: wait until it arrives
    for _ in range(30):
        rig.tick((0, 0, WEIGHT))
    held = factor()
    for _ in range(100):
        rig.tick((0, 0, WEIGHT))
    assert factor() == held


def test_mapping_parameters_of_the_autopilot_are_adopted(make_rig):
    rig = make_rig("-p", "autopilot_parameters:=adopt")
    rig.autopilot.set_parameter("THR_MDL_FAC", 0.3)
    rig.autopilot.set_parameter("MC_ROLLRATE_P", 0.3)
    rig.fly()
    rig.node.until_logged("adopted from the autopilot: MC_ROLLRATE_P is 0.3")
    rates, _ = rig.tick((0, 0, WEIGHT), (0.1, 0.0, 0.0))
    assert rates == pytest.approx([0.1 / (5.00105 * 0.3), 0, 0], rel=1e-3, abs=1e-9)
    # never in flight
    rig.autopilot.set_parameter("MC_PITCHRATE_P", 0.3)
    rig.companion.handle(
        rig.body.time, mavlink2.MAVLink_param_request_read_message(1, 1, b"MC_PITCHRATE_P", -1)
    )
    for _ in range(20):
        rig.tick((0, 0, WEIGHT))
    rig.node.until_logged("MC_PITCHRATE_P is 0.3 on the autopilot, the bridge assumes 0.15")
    gyro = rig.body.gyro.copy()
    rates, _ = rig.tick((0, 0, WEIGHT), (0.0, 0.1, 0.0))
    assert rates[1] - gyro[1] == pytest.approx(0.1 / (5.00105 * 0.15), rel=1e-3)


def test_battery_and_health_are_published(make_rig, probe):
    batteries = probe.collect(topics.AUTOPILOT_BATTERY)
    reports = probe.collect(topics.DIAGNOSTICS)
    rig = make_rig()
    for _ in range(700):
        rig.tick()
    assert len(batteries) >= 2 and not batteries[-1].present
    assert math.isnan(batteries[-1].voltage) and math.isnan(batteries[-1].percentage)
    rig.socket.sendto(
        rig.codec.encode(
            mavlink2.MAVLink_battery_status_message(
                0, 0, 1, 2500, [4000] * 4 + [65535] * 6, 500, 100, -1, 75
            )
        ),
        ("127.0.0.1", rig.local),
    )
    for _ in range(260):
        rig.tick()
    assert any(
        b.present
        and b.voltage == pytest.approx(16.0)
        and b.current == pytest.approx(-5.0)
        and b.percentage == pytest.approx(0.75)
        for b in batteries
    )

    def values():
        found = [s for m in reports for s in m.status if s.name == "mavlink_bridge"]
        return {pair.key: pair.value for pair in found[-1].values} if found else {}

    def reported():
        rig.tick()  # the rate counts ticks, and reports come once a second of them
        return values().get("estimator") and float(values()["messages [1/s]"]) > 20.0

    probe.until(reported, "flags of the estimator, and more than 20 messages a second")
    assert "attitude" in values()["estimator"] and values()["round trip [ms]"]
    assert values()["messages lost"] == "0"
