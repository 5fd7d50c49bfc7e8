"""OffboardLink with the autopilot stand-in in memory: set-up, cuts, reboots, lost modes."""

import struct

import numpy as np
import pytest
from memory_transport import Memory

from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import MavCmd, MavResult, Mode
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.setpoints.targets import AttitudeTarget
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.mavlink.link.link import UNSIGNED, OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Signing, clean_text, mavlink2
from uam_sim_bridge.mavlink.telemetry.events import SUMMARY, EventMessage, event_id
from uam_sim_bridge.mavlink.telemetry.streams import ON_CHANGE, ONLY_COUNTED, RATES

DOWN = np.array([0.0, 0.0, -9.81])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
ARM = (MavCmd.ARM_DISARM, 1.0)


class Rig:
    """Link and autopilot, tick by tick, with a body at rest.

    `cut`: all messages are lost; `lost_kinds`: message types that never reach the autopilot;
    `received`: the messages that did; `reasons_seen`: all reasons of the sequence.
    """

    def __init__(self, **parameters):
        self.memory = Memory()
        self.sequence = OffboardSequence(OffboardParameters(**parameters))
        self.link = OffboardLink(
            self.memory, self.sequence, RateThrustParameters.of(load_description())
        )
        self.codec, self.framer = Codec(1, 1), Framer(Codec(1, 1))
        self.ticks, self.cut, self.vision = 0, False, True
        self.lost_kinds = ()
        self.received = []
        self.reasons_seen = set()
        self.boot()

    def boot(self):
        """Start a new autopilot: clock at zero, disarmed, sequence numbers from zero."""
        self.autopilot = Autopilot()
        for name in ("THR_MDL_FAC",):
            self.autopilot.set_parameter(name, 0.3)
        self.companion = Companion(self.autopilot)
        self.codec = Codec(1, 1)
        self.booted = self.ticks

    @property
    def time(self):
        return 0.004 * self.ticks

    @property
    def uptime(self):
        return 0.004 * (self.ticks - self.booted)

    def send(self, *messages):
        for message in messages:
            frame = self.codec.encode(message)
            if not self.cut:
                self.memory.to_link.append(frame)

    def run(self, seconds, autopilot=True):
        """Run both for `seconds`; autopilot: False while it boots and sends nothing."""
        for _ in range(round(seconds / 0.004)):
            link = self.link
            link.poll(self.time)
            link.tick(self.time)
            if self.sequence.streaming:
                link.send_setpoint(AttitudeTarget.of_rates(np.zeros(3), 0.5), self.time)
                self.sequence.streamed(self.time)
            self.reasons_seen.update(self.sequence.reasons)
            sent, self.memory.to_autopilot = self.memory.to_autopilot, []
            if autopilot:
                self._autopilot(b"" if self.cut else b"".join(sent))
            self.ticks += 1

    def _autopilot(self, data):
        for message in self.framer.datagram(data):
            if message.get_type() not in self.lost_kinds:
                self.received.append(message)
                self.companion.handle(self.uptime, message)
        if self.vision and self.ticks % 5 == 0:
            self.autopilot.vision(self.uptime, np.zeros(3), LEVEL)
        self.autopilot.update(self.uptime, np.zeros(3), DOWN)
        self.send(*self.companion.tick(self.uptime))

    def fly(self):
        self.sequence.set_desired(True)
        self.run(2.0)
        assert self.sequence.phase is Phase.FLYING, self.sequence.reasons
        self.received.clear()
        return self

    def commands(self):
        return [(m.command, m.param1) for m in self.received if m.get_type() == "COMMAND_LONG"]

    def reasons(self):
        return "; ".join(self.reasons_seen)


@pytest.fixture
def rig():
    return Rig()


def test_set_up(rig):
    rig.run(6.0)
    link = rig.link
    streams = [first for command, first in rig.commands() if command == MavCmd.SET_MESSAGE_INTERVAL]
    assert streams == [*(number for number in RATES if number not in ONLY_COUNTED), *ON_CHANGE]
    read = [clean_text(m.param_id) for m in rig.received if m.get_type() == "PARAM_REQUEST_READ"]
    assert sorted(read) == sorted(FIRMWARES["px4"].watched)
    assert link.parameters.mapping_read and link.warnings == ()
    assert link.lost == link.framer.bad_bytes == 0 and link.statistics.rate > 30.0


def test_an_autopilot_of_another_system_is_named(rig):
    rig.codec = Codec(2, 1)
    rig.run(3.0)
    assert rig.link.foreign == {2} and not rig.link.alive and rig.link.ignored > 10
    (line,) = [one for one in rig.link.warnings if "heartbeat" in one]
    assert line.startswith("no heartbeat of system 1, but of system 2: set autopilot_system")
    rig.codec = Codec(1, 1)
    rig.run(3.0)
    assert rig.link.alive and not [one for one in rig.link.warnings if "heartbeat" in one]


def test_time_is_compared_both_ways(rig):
    rig.run(3.0)
    sync = rig.link.time_sync
    assert sync.round_trip == pytest.approx(0.004, abs=0.0041)
    assert sync.offset == pytest.approx(0.0, abs=0.005)
    ours = [m for m in rig.received if m.get_type() == "TIMESYNC"]
    assert len([m for m in ours if m.tc1 == 0]) == pytest.approx(15, abs=2)
    assert len([m for m in ours if m.tc1 != 0]) == pytest.approx(30, abs=2)


def test_the_report_shows_the_autopilots_health(rig):
    rig.fly()
    values = rig.link.values()
    assert "attitude" in values["estimator"] and values["battery [V]"] is None
    assert rig.link.faults() == () and values["sensors unhealthy"] == ""
    rig.vision = False
    rig.run(2.0)
    assert "autopilot: no horizontal position estimate" in rig.link.faults()
    assert rig.link.values()["sensors unhealthy"] == "vision_position"


def test_a_battery_that_only_sys_status_reports(rig):
    rig.run(2.5)
    assert not rig.link.vitals.battery.known
    rig.send(mavlink2.MAVLink_sys_status_message(0, 0, 0, 0, 15200, 250, 80, 0, 0, 0, 0, 0, 0))
    rig.run(0.008)
    assert rig.link.vitals.battery.voltage == pytest.approx(15.2)


def test_cut_of_a_fifth_of_a_second_changes_nothing(rig):
    rig.fly().cut = True
    rig.run(0.2)
    assert not rig.link.silent(rig.time)
    rig.cut = False
    rig.run(1.0)
    assert rig.sequence.phase is Phase.FLYING and rig.autopilot.status.mode is Mode.OFFBOARD
    assert rig.reasons() == "" and rig.link.lost > 0
    assert not any(c == MavCmd.DO_SET_MODE for c, _ in rig.commands())


def offboard_requests(rig):
    return sum(command == MavCmd.DO_SET_MODE for command, _ in rig.commands())


def test_cut_of_two_seconds_is_a_failsafe_and_the_vehicle_stays_released(rig):
    rig.fly().cut = True
    rig.run(2.0)
    assert rig.autopilot.status.mode is Mode.LAND and rig.link.connected(rig.time)
    assert rig.sequence.phase is Phase.FLYING and rig.sequence.streaming
    assert rig.link.silent(rig.time)  # it may be descending, for all that is known
    rig.cut = False
    rig.run(2.0)
    assert not rig.link.silent(rig.time)
    assert rig.sequence.phase is Phase.RELEASED and rig.sequence.streaming
    assert rig.sequence.released_to == (
        "the autopilot's failsafe after a lost stream of setpoints, in LAND"
    )
    assert rig.autopilot.status.mode is Mode.LAND and offboard_requests(rig) == 0
    assert "left OFFBOARD: the autopilot's failsafe after a lost stream" in rig.reasons()
    rig.sequence.regain(rig.time)
    rig.run(1.0)
    assert rig.autopilot.status.mode is Mode.OFFBOARD and rig.sequence.phase is Phase.FLYING


def test_return_after_lost_link_requests_offboard_after_a_cut():
    rig = Rig(return_after_lost_link=True)
    rig.fly().cut = True
    rig.run(2.0)
    rig.cut = False
    rig.run(2.0)
    assert rig.autopilot.status.mode is Mode.OFFBOARD and rig.autopilot.status.armed
    assert rig.sequence.phase is Phase.FLYING and offboard_requests(rig) == 1
    assert ARM not in rig.commands()


def test_return_after_lost_link_leaves_a_mode_of_the_pilot():
    """The pilot chooses HOLD during the cut, and LAND in the failsafe that came before."""
    for wait, mode in ((0.5, Mode.HOLD), (1.5, Mode.LAND)):
        rig = Rig(return_after_lost_link=True)
        rig.fly().cut = True
        rig.run(wait)
        rig.autopilot.command(rig.uptime, MavCmd.DO_SET_MODE, FIRMWARES["px4"].mode_request(mode))
        rig.run(2.0 - wait)
        rig.cut = False
        rig.run(5.0)
        assert rig.autopilot.status.mode is mode and offboard_requests(rig) == 0
        assert rig.sequence.released_to == f"the pilot or a ground station, in {mode.name}"


def test_cut_for_good(rig):
    rig.fly().cut = True
    rig.run(5.0)
    assert not rig.link.connected(rig.time)
    # the link to the autopilot may still work: the bridge continues the stream
    assert rig.sequence.phase is Phase.FLYING and rig.sequence.streaming
    assert rig.autopilot.status.mode is Mode.LAND


def test_disarmed_behind_a_cut_is_not_armed_again(rig):
    rig.fly().cut = True
    rig.run(4.0)
    rig.autopilot.commander.armed = False
    rig.cut = False
    rig.run(5.0)
    assert rig.sequence.phase is Phase.FAILED and "disarmed by itself" in rig.reasons()
    rig.cut = True
    rig.run(4.0)
    rig.cut = False
    rig.run(5.0)
    assert rig.sequence.phase is Phase.FAILED and not rig.autopilot.status.armed
    assert ARM not in rig.commands()


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.HOLD, Mode.RETURN])
def test_a_mode_of_a_ground_station_stays(mode):
    """CURRENT_MODE reports the change at once: the next heartbeat may be a second later."""
    rig = Rig(return_after_lost_link=True).fly()
    rig.run(0.5)
    rig.autopilot.command(rig.uptime, MavCmd.DO_SET_MODE, FIRMWARES["px4"].mode_request(mode))
    rig.run(0.012)
    assert rig.sequence.phase is Phase.RELEASED
    assert rig.sequence.released_to == f"the pilot or a ground station, in {mode.name}"
    rig.run(5.0)
    assert rig.autopilot.status.mode is mode and offboard_requests(rig) == 0
    assert f"left OFFBOARD: the pilot or a ground station, in {mode.name}" in rig.reasons()
    assert rig.link.intended is mode and not rig.link.failsafe


def test_sticks_take_over_and_the_pilots_switch_gives_control_back(rig):
    rig.autopilot.set_parameter("COM_RC_OVERRIDE", 2)
    rig.fly()
    rig.autopilot.manual(rig.uptime, (0.0, 0.0, 0.0, 0.0))
    rig.autopilot.manual(rig.uptime, (0.5, 0.0, 0.0, 0.0))
    assert rig.autopilot.status.mode is Mode.POSITION
    rig.run(0.1)
    assert rig.sequence.released_to == "the pilot or a ground station, in POSITION"
    rig.autopilot.command(rig.uptime, MavCmd.DO_SET_MODE, (1.0, 6.0, 0.0))
    rig.run(0.1)
    assert rig.sequence.phase is Phase.FLYING and offboard_requests(rig) == 0


def test_a_failsafe_of_the_battery_is_named_and_stays():
    rig = Rig(return_after_lost_link=True).fly()
    for name, value in (("SIM_BAT_ENABLE", 1), ("SIM_BAT_DRAIN", 1.0), ("SIM_BAT_MIN_PCT", 6.0)):
        rig.autopilot.set_parameter(name, value)
    rig.autopilot.set_parameter("COM_LOW_BAT_ACT", 2)
    rig.run(3.0)
    assert rig.autopilot.status.mode is Mode.LAND and offboard_requests(rig) == 0
    assert rig.link.failsafe and rig.link.intended is Mode.OFFBOARD
    assert rig.sequence.released_to == "the autopilot's failsafe, in LAND"


def test_kill_is_sent_at_once_and_until_the_motors_stop(rig):
    rig.fly()
    rig.lost_kinds = ("COMMAND_LONG",)
    rig.link.kill()
    rig.run(0.6)
    assert rig.autopilot.status.armed
    rig.lost_kinds = ()
    rig.run(0.6)
    assert not rig.autopilot.status.armed
    kills = [m for m in rig.received if m.get_type() == "COMMAND_LONG"]
    assert {(m.command, m.param1, m.param2) for m in kills} == {
        (MavCmd.ARM_DISARM, 0.0, 21196.0)  # MAV_CMD_COMPONENT_ARM_DISARM's "force"
    }
    rig.received.clear()
    rig.run(5.0)
    assert ARM not in rig.commands() and "killed by command" in rig.reasons()


def test_reboot_on_the_ground_repeats_all_requests(rig):
    rig.run(8.0)
    rig.received.clear()
    rig.boot()
    rig.run(1.0)
    assert rig.link.reboots == 1 and rig.sequence.phase is Phase.STREAMING
    intervals = [c for c, _ in rig.commands() if c == MavCmd.SET_MESSAGE_INTERVAL]
    assert len(intervals) == len(RATES) - len(ONLY_COUNTED) + len(ON_CHANGE)
    assert rig.link.parameters.mapping_read and rig.link.time_sync.offset == pytest.approx(
        -8.0, abs=0.01
    )
    rig.sequence.set_desired(True)
    rig.run(2.0)
    assert rig.sequence.phase is Phase.FLYING and rig.link.reboots == 1


def test_reboot_in_flight_is_never_armed_again(rig):
    rig.run(8.0)
    rig.fly()
    rig.run(1.0, autopilot=False)
    rig.boot()
    rig.run(20.0)
    assert rig.link.reboots == 1 and rig.sequence.phase is Phase.FAILED
    assert "the autopilot rebooted in flight → check its power supply" in rig.reasons()
    assert not rig.autopilot.status.armed and ARM not in rig.commands()
    assert rig.sequence.streaming  # setpoints for an autopilot that continues to fly


def test_slow_reboot_in_flight_behind_a_heartbeat_gap(rig):
    rig.run(10.0)
    rig.fly()
    rig.run(5.0, autopilot=False)
    assert not rig.link.connected(rig.time)
    rig.boot()
    rig.run(20.0)
    assert rig.link.reboots == 1 and rig.sequence.phase is Phase.FAILED
    assert ARM not in rig.commands()


def test_messages_out_of_order_are_no_reboot(rig):
    rig.run(5.0)
    late = round((rig.uptime - 0.5) * 1e3)
    rig.send(mavlink2.MAVLink_attitude_quaternion_message(late, 1, 0, 0, 0, 0, 0, 0))
    rig.run(0.1)
    assert rig.link.reboots == 0


def test_ticks_that_fall_behind_and_catch_up_are_no_reboot(rig):
    """A busy machine: the bridge is a second late, answers seem to come from a second ahead."""
    rig.run(5.0)
    rig.fly()
    for lag in (1.5, 0.0, 3.0, 0.0):
        sync, now = rig.link.time_sync, rig.time - lag
        for k in range(4):
            asked = now + 0.2 * k
            ts1 = sync.request(asked)
            tc1 = round((rig.uptime + 0.2 * k) * 1e9)
            if ts1 is not None:
                rig.send(mavlink2.MAVLink_timesync_message(tc1, ts1))
                rig.link.poll(asked)
        rig.run(1.0)
    assert rig.link.reboots == 0 and rig.sequence.phase is Phase.FLYING


def test_a_parameter_that_never_arrives_is_a_warning(rig):
    rig.lost_kinds = ("PARAM_REQUEST_READ",)
    rig.run(7.0)
    assert "THR_MDL_FAC: no answer from the autopilot to 10 requests" in rig.link.warnings
    requests = len([m for m in rig.received if m.get_type() == "PARAM_REQUEST_READ"])
    rig.run(5.0)
    assert requests == 0 and not rig.link.parameters.mapping_read


def test_differences_and_a_short_loss_time_are_warnings():
    rig = Rig()
    rig.autopilot.set_parameter("COM_OF_LOSS_T", 0.3)
    rig.autopilot.set_parameter("MC_ROLLRATE_P", 0.3)
    rig.run(1.0)
    assert rig.link.warnings == (
        "MC_ROLLRATE_P is 0.3 on the autopilot, the bridge assumes 0.15",
        "COM_OF_LOSS_T is 0.3 s on the autopilot: a gap of 0.5 s between setpoints starts its "
        "failsafe; set a longer time",
    )


def test_integer_parameters_are_read_by_type(rig):
    rig.run(0.1)
    value = struct.unpack("<f", struct.pack("<i", 7))[0]
    rig.send(
        mavlink2.MAVLink_param_value_message(
            b"MC_ROLLRATE_P", value, mavlink2.MAV_PARAM_TYPE_INT32, 900, 17
        )
    )
    rig.run(0.1)
    assert rig.link.parameters.values["MC_ROLLRATE_P"] == 7


def test_the_link_requests_the_reasons_of_a_refused_arming(rig):
    rig.vision = False
    rig.sequence.set_desired(True)
    rig.run(3.0)
    sent = [c for c, _ in rig.commands()]
    assert sent.count(MavCmd.RUN_PREARM_CHECKS) == 1 < sent.count(MavCmd.ARM_DISARM)
    summary = struct.pack("<BIIII", 0, 0, 0, 1, 1)
    rig.send(
        EventMessage(0, 0, event_id(SUMMARY), 0, 1, 8, summary),
        EventMessage(
            0, 0, event_id("check_modes_attitude"), 0, 2, 2, struct.pack("<IB", 0xFFFFFFFF, 16)
        ),
    )
    rig.run(0.1)
    assert "No valid attitude estimate" not in rig.reasons()  # it may pass
    rig.run(6.0)
    rig.send(
        EventMessage(
            0, 0, event_id("check_modes_attitude"), 0, 3, 2, struct.pack("<IB", 0xFFFFFFFF, 16)
        )
    )
    rig.run(0.1)
    assert "No valid attitude estimate → hold the vehicle still" in rig.reasons()


def test_answers_to_other_components_are_ignored(rig):
    rig.sequence.set_desired(True)
    rig.run(0.02)
    rig.send(
        mavlink2.MAVLink_command_ack_message(
            MavCmd.ARM_DISARM, MavResult.DENIED, 0, 0, 255, mavlink2.MAV_COMP_ID_MISSIONPLANNER
        )
    )
    rig.run(2.0)
    assert "denied" not in rig.reasons() and rig.sequence.phase is Phase.FLYING


def test_a_heartbeat_of_another_component_is_not_the_autopilots(rig):
    """A gimbal that names itself a generic autopilot: it is not armed, and has no mode."""
    rig.fly()
    gimbal = Codec(1, mavlink2.MAV_COMP_ID_GIMBAL)
    said = mavlink2.MAVLink_heartbeat_message(26, mavlink2.MAV_AUTOPILOT_GENERIC, 0, 0, 4, 3)
    rig.memory.to_link.append(gimbal.encode(said))
    rig.run(1.0)
    assert rig.sequence.phase is Phase.FLYING and rig.link.armed


def test_the_same_messages_twice():
    """The link depends on ticks and messages only."""

    def messages():
        rig = Rig()
        rig.fly()
        rig.cut = True
        rig.run(1.5)
        rig.cut = False
        rig.run(1.0)
        return [rig.codec.encode(m) for m in rig.received]

    assert messages() == messages()


def test_the_autopilots_imu_is_requested_and_stamped_with_the_companions_clock():
    rig = Rig()
    began = 1_000.0  # [s] companion's clock at the first tick
    rig.link = OffboardLink(
        rig.memory,
        rig.sequence,
        RateThrustParameters.of(load_description()),
        imu_rate=250.0,
        clock=lambda: began + rig.time,
    )
    rig.run(4.0)
    samples = rig.link.imu.samples()
    steps = np.diff([sample.stamp for sample in samples])
    assert len(samples) == 32  # those not yet read are bounded
    assert np.abs(steps - 4_000_000).max() < 1000
    newest = samples[-1]
    # request and answer take a tick each way, or less: half of the difference is the error
    assert newest.stamp * 1e-9 - began == pytest.approx(rig.time - 0.004, abs=0.0041)
    np.testing.assert_allclose(newest.force, [0.0, 0.0, 9.80665], atol=0.01)
    assert rig.link.streams.warnings == ()
    rig.boot()
    rig.run(0.5)
    assert rig.link.reboots == 1


@pytest.mark.parametrize("signs", [False, True])
def test_an_autopilot_that_does_not_sign_is_refused_with_the_reason(signs):
    key = Signing(bytes(32))
    memory, sequence = Memory(), OffboardSequence()
    mapping = RateThrustParameters.of(load_description())
    link = OffboardLink(memory, sequence, mapping, signing=key)
    codec = Codec(1, 1, key if signs else None)
    hold = FIRMWARES["px4"].custom_mode(Mode.HOLD)
    beat = mavlink2.MAVLink_heartbeat_message(2, 12, 1, hold, 3, 3)
    for tick in range(10):
        memory.to_link.append(codec.encode(beat))
        if signs:  # a forged one beside the true ones
            memory.to_link.append(Codec(1, 1).encode(beat))
        link.poll(0.1 * tick)
        link.tick(0.1 * tick)
    assert link.connected(0.9) is signs
    assert (UNSIGNED in link.warnings) is not signs
    assert [reason.startswith("the autopilot does not sign") for reason in sequence.reasons] == (
        [] if signs else [True]
    )
