"""uam doctor: the autopilot at a MAVLink link, simulated with real sockets."""

import socket
import struct
import threading

import pytest

from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import Mode
from uam_lab.preflight.doctor import autopilot
from uam_lab.preflight.doctor.finding import Verdict
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, clean_text, mavlink2
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE, RequiredParameters
from uam_sim_bridge.px4.px4_installation import VARIABLE

OK, WARN, FAIL = Verdict
PATIENCE = 20.0  # [s] only a failing test, or a very busy machine, waits that long


class StandIn:
    """Answers each datagram on a UDP port until closed; `answer`: message → messages."""

    def __init__(self, answer, raw=b""):
        self._answer, self._raw = answer, raw
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.05)
        self.url = f"udp:127.0.0.1:{self._socket.getsockname()[1]}"
        self._open = True
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        codec = Codec(3, 1)
        framer = Framer(codec)
        while self._open:
            try:
                data, place = self._socket.recvfrom(4096)
            except TimeoutError:
                continue
            for message in framer.datagram(data):
                for reply in self._answer(message):
                    self._socket.sendto(codec.encode(reply), place)
            if self._raw:
                self._socket.sendto(self._raw, place)

    def close(self):
        self._open = False
        self._thread.join()
        self._socket.close()


@pytest.fixture
def stand_in():
    """stand_in(answer) starts one; it ends with the test."""
    running = []

    def start(*arguments, **options):
        running.append(StandIn(*arguments, **options))
        return running[-1]

    yield start
    for one in running:
        one.close()


def first(findings):
    """Return the first finding, that about the autopilot itself."""
    return next(iter(findings))


def heartbeat(kind=mavlink2.MAV_AUTOPILOT_PX4, base_mode=1, mode=Mode.HOLD):
    return mavlink2.MAVLink_heartbeat_message(
        mavlink2.MAV_TYPE_QUADROTOR, kind, base_mode, FIRMWARES["px4"].custom_mode(mode), 4, 3
    )


def px4(message):
    """As PX4: a heartbeat, and its version on request."""
    if message.get_type() == "COMMAND_LONG" and message.command == 512:
        assert message.param1 == mavlink2.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        assert message.target_system == 3
        yield mavlink2.MAVLink_autopilot_version_message(
            0, 0x011002FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
        )
    else:
        yield heartbeat()


def test_an_autopilot_is_named_with_system_type_mode_and_firmware(stand_in):
    found = first(autopilot.link(stand_in(px4).url, PATIENCE))
    # another system than the bridge speaks to without a word
    assert found.verdict is WARN and "autopilot_system: 3" in found.advice
    for word in ("system 3", "px4", "quadrotor", "mode HOLD", "disarmed", "firmware 1.16.2"):
        assert word in found.found


def test_without_a_version_the_rest_is_said(stand_in):
    def answer(message):
        return [heartbeat(base_mode=129)] if message.get_type() == "HEARTBEAT" else []

    found = first(autopilot.link(stand_in(answer).url, PATIENCE))
    assert found.verdict is WARN and "firmware version not sent" in found.found
    assert "ARMED" in found.found


def test_another_autopilot_is_a_warning(stand_in):
    ardupilot = heartbeat(kind=mavlink2.MAV_AUTOPILOT_ARDUPILOTMEGA)
    found = first(autopilot.link(stand_in(lambda _: [ardupilot]).url, PATIENCE))
    assert found.verdict is WARN and "ardupilotmega" in found.found


def test_silence_other_messages_and_noise_are_distinguished(stand_in):
    found = first(autopilot.link(stand_in(lambda _: []).url, 0.3))
    assert found.verdict is FAIL and "nothing within 0.3 s" in found.found
    text = mavlink2.MAVLink_statustext_message(6, b"camera")
    found = first(autopilot.link(stand_in(lambda _: [text]).url, 2.0))
    assert found.verdict is FAIL and "STATUSTEXT" in found.found
    found = first(autopilot.link(stand_in(lambda _: [], raw=b"login: ").url, 2.0))
    assert found.verdict is FAIL and "bytes, but no MAVLink" in found.found
    assert "baud" in found.advice


def test_a_link_that_cannot_be_opened_fails():
    found = first(autopilot.link("serial:/dev/no-such-device:57600"))
    assert found.verdict is FAIL and "no-such-device" in found.found


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0x011000FF, "1.16.0"),
        (0x010F0180, "1.15.1 beta"),
        (0x010E00C0, "1.14.0 rc"),
        (0x01110000, "1.17.0 dev"),
    ],
)
def test_versions_in_words(number, text):
    assert autopilot.version(number) == text


def test_px4_in_software_is_there_or_not(tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert autopilot.px4().verdict is OK
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert autopilot.px4().verdict is WARN
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "px4").touch(0o755)
    (tmp_path / "etc" / "init.d-posix").mkdir(parents=True)
    (tmp_path / "etc" / "init.d-posix" / "rcS").touch()
    found = autopilot.px4()
    assert found.verdict is OK and str(tmp_path) in found.found


PARAMETERS = {
    "CBRK_SUPPLY_CHK": (894281, mavlink2.MAV_PARAM_TYPE_INT32),
    "COM_LOW_BAT_ACT": (3, mavlink2.MAV_PARAM_TYPE_INT32),
    "COM_OF_LOSS_T": (0.5, mavlink2.MAV_PARAM_TYPE_REAL32),
}


def test_parameters_of_a_vehicle_are_compared(stand_in):
    requested = []

    def answer(message):
        if message.get_type() != "PARAM_REQUEST_READ":
            yield from px4(message)
            return
        name = clean_text(message.param_id)
        requested.append(name)
        if name in PARAMETERS and requested.count(name) > 1:  # the first answer is lost
            value, kind = PARAMETERS[name]
            if kind == mavlink2.MAV_PARAM_TYPE_INT32:
                value = struct.unpack("<f", struct.pack("<i", value))[0]
            yield mavlink2.MAVLink_param_value_message(name.encode(), value, kind, 900, 7)

    found = list(autopilot.link(stand_in(answer).url, PATIENCE, 3.0))
    rows = {finding.check: finding for finding in found[1:]}
    assert list(rows) == list(RequiredParameters.read(VEHICLE))
    assert rows["CBRK_SUPPLY_CHK"].verdict is WARN
    assert rows["CBRK_SUPPLY_CHK"].found.startswith("894281, 0 required")
    assert rows["COM_LOW_BAT_ACT"].verdict is OK and rows["COM_OF_LOSS_T"].verdict is OK
    assert rows["SYS_HITL"].verdict is WARN and "not answered" in rows["SYS_HITL"].found


def test_another_autopilots_parameters_are_not_read(stand_in):
    ardupilot = heartbeat(kind=mavlink2.MAV_AUTOPILOT_ARDUPILOTMEGA)
    found = list(autopilot.link(stand_in(lambda _: [ardupilot]).url, PATIENCE))
    assert [finding.check for finding in found] == ["autopilot"]
