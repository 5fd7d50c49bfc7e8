"""Every text of PX4 that keeps the vehicle on the ground leads to the right advice."""

import re

import pytest

from uam_control.offboard.exchange import Request
from uam_control.offboard.firmware import FIRMWARES, SEPARATOR
from uam_control.offboard.modes import MavResult
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence
from uam_sim_bridge.mavlink.telemetry.events import EventTexts

PX4 = FIRMWARES["px4"]
EVENTS = EventTexts(PX4)

TEXTS = [  # PX4 v1.16.0, STATUSTEXT
    ("Preflight Fail: ekf2 missing data", "EKF2_EV_CTRL"),
    ("Preflight Fail: heading estimate not stable", "mocap body's axes"),
    ("Preflight Fail: horizontal position unstable", "EKF2_EV_DELAY"),
    ("Preflight Fail: horizontal velocity unstable", "hold the vehicle still"),
    ("Preflight Fail: height estimate not stable", "EKF2_HGT_REF"),
    ("Preflight Fail: High Accelerometer Bias", "calibrate"),
    ("Preflight Fail: Accel 0 uncalibrated", "calibrate the IMU"),
    ("Preflight Fail: Gyro Sensor 1 missing", "calibrate the IMU"),
    ("Preflight Fail: No valid data from Gyro 0", "calibrate the IMU"),
    ("Preflight Fail: Accel 1 inconsistent - check cal", "calibrate the IMU"),
    ("Preflight Fail: No valid data from Compass 0", "SYS_HAS_MAG"),
    ("Preflight Fail: Strong magnetic interference", "SYS_HAS_MAG"),
    ("Preflight Fail: barometer 0 missing", "SYS_HAS_BARO"),
    ("Preflight Fail: Global position estimate required", "COM_ARM_WO_GPS"),
    ("Preflight Fail: Kill switch engaged", "release the switch"),
    ("Preflight Fail: Press safety button first", "CBRK_IO_SAFETY"),
    ("Preflight Fail: Flying with USB is not safe", "CBRK_USB_CHK"),
    ("Preflight Fail: Avionics Power low:   4.50 Volt", "power module"),
    ("Preflight Fail: system power unavailable", "CBRK_SUPPLY_CHK"),
    ("Preflight Fail: Battery unhealthy", "battery"),
    ("Preflight Fail: ESC telemetry missing", "ESCs"),
    ("Preflight Fail: Attitude failure (roll)", "failure detector"),
    ("Preflight Fail: CPU load too high: 95.0%", "COM_CPU_MAX"),
    ("Preflight Fail: Crash dumps present on SD", "COM_ARM_HFLT_CHK"),
    ("Preflight Fail: No connection to the ground control station", "NAV_DLL_ACT"),
    ("Arming denied: Resolve system health failures first", "commander check"),
    ("Arming denied: switch to manual mode first", "OFFBOARD first"),
    ("Arming denied: calibrating", "calibration is done"),
    ("Disarming denied: not landed", "LNDMC"),
    ("Switching to Offboard is currently not available", "requirements"),
    ("Failsafe activated", "reason beside it"),
    ("Manual control loss: switching to RTL", "COM_RCL_EXCEPT"),
    ("left OFFBOARD: the autopilot's failsafe, in LAND, has control", "COM_OF_LOSS_T"),
    ("left OFFBOARD: the pilot or a ground station, in POSITION, has control", "uam resume"),
    ("the autopilot rebooted", "power supply"),
    ("no offboard signal", "2 Hz"),
]


@pytest.mark.parametrize(("text", "part"), TEXTS)
def test_texts_of_px4(text, part):
    assert part in PX4.advice(text)


def test_every_event_in_the_table_has_advice():
    texts = [text for text, _ in (*EVENTS.checks.values(), *EVENTS.others.values())]
    filled = [
        re.sub(r"{\d[^}]*}", "1", text).replace("{cause}", "GCS connection loss") for text in texts
    ]
    assert [text for text in filled if PX4.advice(text) is None] == []


def test_every_pattern_is_reachable():
    """A pattern that an earlier one always beats is a mistake: each is some text's first match."""
    events = [
        re.sub(r"{\d[^}]*}", "1", text).replace("{cause}", "generic")
        for text, _ in (*EVENTS.checks.values(), *EVENTS.others.values())
    ]
    message = (
        [text for text, _ in TEXTS]
        + events
        + [
            "Imbalanced propeller detected",
            "Arm auth: Denied",
            "arming refused (temporarily rejected)",
            "arming refused (denied)",
            "the autopilot disarmed by itself",
            "Missing FMU SD Card",
        ]
    )
    used = {PX4.advice(text) for text in message}
    assert [pattern for pattern, what in PX4.advice_by_pattern.items() if what not in used] == []


def test_unknown_texts_stay_as_they_are():
    assert PX4.with_advice("hello") == "hello"
    assert PX4.with_advice("descending slowly, escaping") == "descending slowly, escaping"
    once = PX4.with_advice("no offboard signal")
    assert SEPARATOR in once and PX4.with_advice(once) == once


def test_the_sequences_reasons_carry_it():
    s = OffboardSequence(OffboardParameters(reason_delay=0.0))
    s.text(2, "Preflight Fail: ekf2 missing data\t")
    s.answer(Request.ARM, MavResult.TEMPORARILY_REJECTED)
    assert s.reasons[0] == (
        "Preflight Fail: ekf2 missing data → the estimator has no vision pose "
        "yet: check mocap and EKF2_EV_CTRL; in HITL reboot the autopilot"
    )
    assert s.reasons[1].startswith("arming refused (temporarily rejected) → an arming check failed")
