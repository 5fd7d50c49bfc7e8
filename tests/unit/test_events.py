"""PX4's events: ids, texts, and the selection of those that block arming in OFFBOARD."""

import struct

import pytest

from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import Severity
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer
from uam_sim_bridge.mavlink.telemetry.events import (
    HEALTH_SUMMARY,
    OFFBOARD,
    SUMMARY,
    EventMessage,
    EventReader,
    EventTexts,
    event_id,
)

ALL_MODES = 0xFFFFFFFF
MANUAL = 1
CRITICAL, ERROR, WARNING, INFO, PROTOCOL = 2, 3, 4, 6, 8


class Autopilot:
    """Packs events, decodes them again and passes them to an EventReader."""

    def __init__(self):
        self.reader = EventReader()
        self.codec, self.framer = Codec(1, 1), Framer(Codec(1, 191))
        self.sequence = 65530

    def send(self, name, level, arguments=b"", again=False):
        self.sequence = (self.sequence + (not again)) % 65536
        number = name if isinstance(name, int) else event_id(name)
        message = EventMessage(0, 0, number, 1000, self.sequence, 4 << 4 | level, arguments)
        (arrived,) = self.framer.datagram(self.codec.encode(message))
        assert arrived.get_type() == "EVENT"
        return self.reader.read(arrived)

    def summary(self, can_arm):
        return self.send(SUMMARY, PROTOCOL, struct.pack("<BIIII", 0, 0, 0, can_arm, ALL_MODES))

    def check(self, name, level, *values, modes=ALL_MODES, layout=""):
        return self.send(name, level, struct.pack("<IB" + layout, modes, 17, *values))


def test_numbers_are_px4s():
    # FNV-1a of "a" and "foobar" are published test vectors; the high byte is the component
    assert event_id("a") == 0x010C292C and event_id("foobar") == 0x019CF968
    texts = EventTexts(FIRMWARES["px4"])
    names = [*texts.checks, *texts.others, SUMMARY, HEALTH_SUMMARY]
    assert len({event_id(name) for name in names}) == len(names)


def test_a_denied_arming_in_px4s_order():
    px4 = Autopilot()
    assert px4.summary(can_arm=MANUAL) is None
    assert px4.check("check_estimator_missing_data", INFO) == (
        Severity.WARNING,
        "Waiting for estimator to initialize",
    )
    assert px4.check("check_modes_attitude", CRITICAL) == (
        Severity.CRITICAL,
        "No valid attitude estimate",
    )
    assert px4.check("check_accel_missing", ERROR, 1, layout="B") == (
        ERROR,
        "Accelerometer sensor 1 missing",
    )
    assert px4.check("check_cpuload_too_high", ERROR, 97.25, layout="f") == (
        ERROR,
        "CPU load too high: 97.2%",
    )
    assert px4.send(HEALTH_SUMMARY, PROTOCOL, bytes(13)) is None
    assert px4.send("commander_arm_denied_resolve_failures", CRITICAL) == (
        CRITICAL,
        "Arming denied: Resolve system health failures first",
    )


def test_checks_that_do_not_block_offboard_give_no_text():
    px4 = Autopilot()
    px4.summary(can_arm=ALL_MODES & ~OFFBOARD)
    assert px4.check("check_modes_mission", INFO, modes=8) is None
    assert px4.check("check_modes_manual_control", WARNING) is None  # lists all modes, blocks none
    assert px4.check("check_modes_manual_control", ERROR) is not None
    assert px4.check("check_modes_offboard_signal", ERROR, modes=OFFBOARD) == (
        ERROR,
        "No offboard signal",
    )


def test_checks_give_no_text_if_offboard_may_be_armed():
    px4 = Autopilot()
    px4.summary(can_arm=ALL_MODES)
    assert px4.check("check_battery_low", WARNING) is None


@pytest.mark.parametrize(
    ("name", "layout", "values", "text"),
    [
        ("commander_failsafe_enter", "IBB", (0, 7, 2), "GCS connection loss: switching to Land"),
        (
            "commander_failsafe_enter_generic",
            "IB",
            (0, 8),
            "Failsafe activated: switching to Descend",
        ),
        (
            "commander_failsafe_enter_hold",
            "IBHB",
            (0, 6, 5, 1),
            "Manual control loss: switching to RTL in 5 seconds",
        ),
        ("commander_failsafe_enter_generic", "IB", (0, 99), "Failsafe activated: switching to 99"),
    ],
)
def test_failsafe_texts_name_cause_and_action(name, layout, values, text):
    assert Autopilot().send(name, CRITICAL, struct.pack("<" + layout, *values)) == (CRITICAL, text)


def test_others():
    px4 = Autopilot()
    assert px4.send("something_new", INFO) is None
    severity, text = px4.send(0x01ABCDEF, CRITICAL)
    assert severity == CRITICAL and "0x01abcdef, of unknown name" in text
    assert px4.send("logger_storage_full", ERROR) == (
        ERROR,
        "event logger_storage_full: see PX4's log",
    )
    assert px4.send("logger_storage_full", INFO) is None
    assert px4.send(0x01ABCDEF, CRITICAL, again=True) is None
    assert px4.send("commander_rc_override", INFO)[0] == Severity.WARNING
