"""One line of advice for each reason why PX4 v1.16 refuses to arm or to fly OFFBOARD.

The patterns match the texts of STATUSTEXT ("Preflight Fail: ...") and of events, the results of
COMMAND_ACK as worded by `OffboardSequence`, and mode changes that PX4 made by itself. The first
matching pattern counts, so narrow patterns come before wide ones.
"""

from __future__ import annotations

import re

SEPARATOR = " → "

# pattern (case does not matter) → what to do
ADVICE: tuple[tuple[str, str], ...] = (
    # estimator and vision
    (r"ekf2 missing data|waiting for estimator|no valid vision pose|external vision missing",
     "the estimator has no vision pose yet: check mocap and EKF2_EV_CTRL"),
    (r"no valid attitude estimate|attitude estimate not aligned",
     "hold the vehicle still and wait; else check IMU calibration and the vision pose"),
    (r"no valid position estimate|horizontal position unstable|position estimate has low accuracy",
     "check mocap, EKF2_EV_CTRL (11: position, height, yaw) and EKF2_EV_DELAY"),
    (r"height estimate not stable|no valid altitude estimate",
     "set EKF2_HGT_REF to vision (3) and check the height that mocap reports"),
    (r"heading estimate not stable|vision tilt differs",
     "vision and IMU disagree: check the mocap body's axes (x forward, z up) and EKF2_EV_CTRL"),
    (r"(horizontal|vertical) velocity unstable",
     "hold the vehicle still; else check EKF2_EV_DELAY and the vision pose for jumps"),
    (r"high (accelerometer|gyro) bias",
     "let the vehicle rest for a minute after power-on; else calibrate the IMU"),
    (r"magnetic interference|compass|\bmag\b",
     "indoors fly without a compass: SYS_HAS_MAG 0, EKF2_MAG_TYPE 5, yaw from vision"),
    (r"gps|gnss|global position|home position",
     "indoors fly without GPS: COM_ARM_WO_GPS 1, SYS_HAS_GPS 0, EKF2_GPS_CTRL 0"),
    (r"barometer|\bbaro\b", "check the barometer; without one SYS_HAS_BARO 0"),
    (r"angular velocity not valid|(accel|gyro)[a-z]*( sensor)? \d+ (missing|uncalibrated)"
     r"|no valid data from (accel|gyro)|(accel|gyro) \d+ inconsistent|accelerometer reads",
     "check and calibrate the IMU, the vehicle at rest"),
    # modes, stream, radio
    (r"no offboard (control )?signal|offboard refused",
     "setpoints must stream faster than 2 Hz: check the link's rate and COM_OF_LOSS_T"),
    (r"no manual control|manual control loss|needs radio control|\brc\b.*lost",
     "switch to OFFBOARD before arming; without a radio set COM_RCL_EXCEPT's bit for OFFBOARD"),
    (r"pilot took over", "a stick moved: see COM_RC_OVERRIDE; request OFFBOARD again when clear"),
    (r"mode not suitable for arming|switch to manual mode|mode .* is not available",
     "request OFFBOARD first, then arm"),
    (r"switching to .* not (available|possible)",
     "the mode's requirements fail: see the reasons beside it"),
    (r"connection to (the )?(gcs|ground)|gcs connection loss|data ?link",
     "connect a ground station or set NAV_DLL_ACT 0"),
    (r"connection to mission computer lost", "PX4 receives no heartbeat: check the link"),
    (r"kill (switch )?engaged|rtl switch engaged", "release the switch on the radio"),
    (r"safety button", "press the safety button or set CBRK_IO_SAFETY"),
    (r"throttle", "put the throttle stick down"),
    # power
    (r"avionics power|system power|power module|power redundancy|overcurrent",
     "check the power module and its wiring; on the bench CBRK_SUPPLY_CHK"),
    (r"battery|flight time low",
     "charge or replace the battery; check BAT1_* and COM_LOW_BAT_ACT"),
    # hardware and software
    (r"\besc\b|\besc[0-9]|motor failure", "check the ESCs, their power and telemetry"),
    (r"attitude failure|altitude failure|flight termination",
     "the failure detector tripped: put the vehicle level, restart PX4, see FD_FAIL_*"),
    (r"imbalanced propeller", "check propellers and motor mounts, FD_IMB_PROP_THR"),
    (r"usb connected|flying with usb", "unplug USB and restart, or set CBRK_USB_CHK"),
    (r"sd card|crash dumps|hardfault", "check the SD card and its logs; COM_ARM_SDCARD, "
     "COM_ARM_HFLT_CHK"),
    (r"cpu|ram usage", "lower message rates or logging; COM_CPU_MAX"),
    (r"safety configuration", "the vehicle is configured not to arm: COM_ARMABLE"),
    (r"arm auth", "the arming authority refused: COM_ARM_AUTH_REQ"),
    (r"calibrating", "wait until the calibration is done"),
    (r"no valid mission", "COM_ARM_MIS_REQ requires a mission: set it 0"),
    # actions of the autopilot by itself
    (r"left offboard for (land|return|hold)",
     "a failsafe: see the text beside it, COM_OF_LOSS_T, COM_OBL_RC_ACT and the link"),
    (r"left offboard for", "the pilot or a ground station changed the mode"),
    (r"autopilot disarmed in flight", "kill switch, failure detector or a wrong land detection"),
    (r"autopilot rebooted", "check its power supply; arm again by hand after the landing"),
    (r"failsafe activated|autopilot disengaged", "see the reason beside it"),
    # results of COMMAND_ACK, and summaries of other texts
    (r"resolve system health failures",
     "the failed checks are the reasons beside it; none: `commander check` in PX4's shell"),
    (r"disarming (denied|refused)|not landed",
     "the land detector does not detect the ground: lower the thrust, LNDMC_*"),
    (r"arming refused \(temporarily", "an arming check failed: see the reasons beside it"),
    (r"refused \((denied|unsupported|failed)",
     "the autopilot does not support this request: check firmware and autopilot_system"),
)  # fmt: skip

_COMPILED = tuple((re.compile(pattern, re.IGNORECASE), what) for pattern, what in ADVICE)


def advice(text: str) -> str | None:
    """Return the advice for `text`; None if no pattern matches."""
    for pattern, what in _COMPILED:
        if pattern.search(text):
            return what
    return None


def with_advice(text: str) -> str:
    """Return `text` followed by its advice; unchanged if it has advice already."""
    what = None if SEPARATOR in text else advice(text)
    return text if what is None else f"{text}{SEPARATOR}{what}"
