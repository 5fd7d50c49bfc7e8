"""Firmwares of autopilots: numbers of modes, names of parameters, files of config/."""

import pytest

from uam_control.offboard.exchange import Request
from uam_control.offboard.firmware import FIRMWARES, Firmware
from uam_control.offboard.modes import MavCmd, Mode
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.mavlink.protocol.wire import mavlink2
from uam_sim_bridge.mavlink.telemetry.events import EventReader, EventTexts
from uam_sim_bridge.mavlink.telemetry.parameter_check import ParameterWatch

PX4 = FIRMWARES["px4"]
PLAIN = "label: plain\nautopilot: 3\nmodes: {OFFBOARD: 4, HOLD: 5, LAND: 9}\n"


@pytest.fixture
def plain(tmp_path):
    (tmp_path / "firmware.yaml").write_text(PLAIN + "loss_time: FS_T\nthr_mdl_fac: [MOT_EXPO]\n")
    return Firmware(tmp_path)


def test_px4_has_main_and_sub_modes():
    """HEARTBEAT.custom_mode: main mode in bits 16..23, sub mode in bits 24..31; LAND is 4, 6."""
    assert PX4.custom_mode(Mode.LAND) == 4 * 65536 + 6 * 16777216
    assert PX4.mode(6 * 65536) is Mode.OFFBOARD and PX4.mode(77) is Mode.UNKNOWN
    assert PX4.mode_request(Mode.LAND) == (1, 4, 6)
    assert {PX4.mode(PX4.custom_mode(one)) for one in Mode} == set(Mode)


def test_a_plain_number_is_the_mode(plain):
    assert plain.custom_mode(Mode.LAND) == 9 and plain.mode_request(Mode.LAND) == (1, 9, 0)
    assert plain.mode(4) is Mode.OFFBOARD and plain.mode(6 * 65536) is Mode.UNKNOWN
    assert plain.custom_mode(Mode.ORBIT) == 0  # it has none


@pytest.mark.parametrize("name", ["px4", "plain"])
def test_the_stand_in_understands_every_request_of_its_firmware(plain, name):
    spoken = plain if name == "plain" else PX4
    for mode in (Mode.OFFBOARD, Mode.HOLD, Mode.LAND):
        _, main, sub = spoken.mode_request(mode)
        assert spoken.requested(main, sub) is mode
    assert spoken.requested(99, 0) is Mode.UNKNOWN


def test_the_sequence_asks_in_its_words(plain, monkeypatch):
    monkeypatch.setitem(FIRMWARES, "plain", plain)
    sequence = OffboardSequence(OffboardParameters(firmware="plain"))
    assert sequence.commands[Request.OFFBOARD] == (MavCmd.DO_SET_MODE, (1, 4, 0))
    assert Autopilot(spoken=plain).command(0.0, MavCmd.DO_SET_MODE, (1.0, 5.0, 0.0)) == 0
    with pytest.raises(ParameterError, match="firmware: 'plane' is not one of px4, plain"):
        OffboardParameters(firmware="plane").validated()


def test_its_parameters_are_compared_as_it_sends_them(plain):
    """An integer comes as a float; PX4's 7 would be the bytes of 9.8e-45."""
    mapping = RateThrustParameters.of(load_description())
    watch = ParameterWatch(mapping, spoken=plain)
    assert watch.due(0.0) == ["MOT_EXPO", "FS_T"]
    integer = mavlink2.MAV_PARAM_TYPE_INT32
    watch.take(mavlink2.MAVLink_param_value_message(b"FS_T", 0.0, integer, 2, 1))
    watch.take(mavlink2.MAVLink_param_value_message(b"MOT_EXPO", 7.0, integer, 2, 0))
    assert watch.mapping_read and watch.values == {"MOT_EXPO": 7.0, "FS_T": 0.0}
    assert watch.warnings[0].startswith("MOT_EXPO is 7 on the autopilot, the bridge assumes ")
    assert watch.warnings[1].startswith("FS_T is 0 on the autopilot")


def test_files_that_it_lacks_are_empty(plain):
    assert plain.advice("anything") is None and not plain.passing("no offboard signal", False)
    assert EventTexts(plain).checks == {} and EventReader(plain)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("modes: {FLY: 4}", "modes: 'FLY' is not one of MANUAL, ALTITUDE"),
        ("modes: {LAND: 9}", "modes: OFFBOARD is missing"),
        ("mode: 4", "label, autopilot and modes are needed"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, change, said):
    (tmp_path / "firmware.yaml").write_text(f"label: x\nautopilot: 3\n{change}\n")
    with pytest.raises(ConfigurationError, match=said) as refused:
        Firmware(tmp_path)
    assert "\n" not in str(refused.value)
