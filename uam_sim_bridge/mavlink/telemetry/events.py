"""Converts PX4's EVENT messages to text without the metadata file of a ground station.

An EVENT carries a hash of the event's name and up to 40 bytes of arguments. The tables below list
the events about arming and about loss of OFFBOARD, with PX4's texts (v1.16.0). PX4 sends the
arming checks as one report:

    summary (which modes may be armed)  →  one event per failed check  →  health summary

A check lists the modes that it concerns, but some checks list all modes and block none. The reader
therefore returns checks only if the summary excludes arming in OFFBOARD.
"""

from __future__ import annotations

import struct

from uam_sim_bridge.mavlink.protocol.modes import Severity
from uam_sim_bridge.mavlink.telemetry.event_messages import ARGUMENTS, EventMessage

OFFBOARD = 1 << 14  # PX4's navigation_mode_group of OFFBOARD
_AUTOPILOT = 1 << 24  # component of the event's name
SUMMARY, HEALTH_SUMMARY = "commander_arming_check_summary", "commander_health_summary"

# Arming and health checks: name → text, struct format of {0}, {1}, ... in the text. The arguments
# of the event: modes uint32, component uint8, then the values of {0}, {1}, ...
CHECKS: dict[str, tuple[str, str]] = {
    # mode requirements: events only, never a STATUSTEXT
    "check_modes_angular_velocity": ("Angular velocity not valid", ""),
    "check_modes_attitude": ("No valid attitude estimate", ""),
    "check_modes_local_pos": ("Navigation error: No valid position estimate", ""),
    "check_modes_global_pos": ("Navigation error: No valid global position estimate", ""),
    "check_modes_local_alt": ("Navigation error: No valid altitude estimate", ""),
    "check_modes_mission": ("No valid mission available", ""),
    "check_modes_offboard_signal": ("No offboard signal", ""),
    "check_modes_home_position": ("Home position not set", ""),
    "check_modes_manual_control": ("No manual control input", ""),
    "check_modes_cannot_takeoff": ("Mode not suitable for arming", ""),
    # estimator
    "check_estimator_missing_data": ("Waiting for estimator to initialize", ""),
    "check_estimator_heading_not_stable": ("Heading estimate not stable", ""),
    "check_estimator_hor_vel_not_stable": ("Horizontal velocity unstable", ""),
    "check_estimator_vert_vel_not_stable": ("Vertical velocity unstable", ""),
    "check_estimator_hor_pos_not_stable": ("Horizontal position unstable", ""),
    "check_estimator_hgt_not_stable": ("Height estimate not stable", ""),
    "check_estimator_mag_interference": ("Strong magnetic interference", ""),
    "check_estimator_high_accel_bias": ("High Accelerometer Bias", ""),
    "check_estimator_high_gyro_bias": ("High Gyro Bias", ""),
    "check_estimator_mag_fault": ("Stopping compass use", ""),
    "check_estimator_low_position_accuracy": ("Position estimate has low accuracy", ""),
    "check_estimator_gps_fix_too_low": ("GPS fix too low", ""),
    "check_estimator_gps_not_fusing": ("Estimator not using GPS", ""),
    "check_estimator_gps_generic": ("Poor GPS Quality", ""),
    # sensors
    "check_accel_missing": ("Accelerometer sensor {0} missing", "B"),
    "check_accel_no_data": ("No valid data from Accelerometer {0}", "B"),
    "check_accel_not_calibrated": ("Accelerometer {0} uncalibrated", "B"),
    "check_gyro_missing": ("Gyro sensor {0} missing", "B"),
    "check_gyro_no_data": ("No valid data from Gyro {0}", "B"),
    "check_gyro_not_calibrated": ("Gyro {0} uncalibrated", "B"),
    "check_mag_missing": ("Compass sensor {0} missing", "B"),
    "check_mag_no_data": ("No valid data from Compass {0}", "B"),
    "check_mag_not_calibrated": ("Compass {0} uncalibrated", "B"),
    "check_mag_consistency": ("Compass inconsistent", ""),
    "check_mag_sys_has_mag_missing": ("Compass missing", ""),
    "check_baro_missing": ("Barometer {0} missing", "B"),
    "check_baro_no_data": ("No valid data from barometer {0}", "B"),
    "check_imu_accel_inconsistent": ("Accel {0} inconsistent", "B"),
    "check_imu_gyro_inconsistent": ("Gyro {0} inconsistent", "B"),
    # power and battery
    "check_battery_missing": ("Battery {0} missing", "B"),
    "check_battery_disconnected": ("Battery {0} disconnected", "B"),
    "check_battery_fault": ("Battery {0} fault", "B"),
    "check_battery_low": ("Low battery", ""),
    "check_battery_critical": ("Critical battery", ""),
    "check_battery_emergency": ("Emergency battery level", ""),
    "check_battery_unhealthy": ("Battery unhealthy", ""),
    "check_avionics_power_missing": ("Power module not connected", ""),
    "check_avionics_power_low": ("Avionics Power low: {0:.2f} Volt", "f"),
    "check_avionics_power_high": ("Avionics Power high: {0:.2f} Volt", "f"),
    "check_avionics_power_redundancy": ("Power redundancy not met", ""),
    "check_missing_system_power": ("System power unavailable", ""),
    # other checks
    "check_missing_cpuload": ("No CPU and RAM load information", ""),
    "check_cpuload_too_high": ("CPU load too high: {0:.1f}%", "f"),
    "check_ram_usage_too_high": ("RAM usage too high: {0:.1f}%", "f"),
    "check_escs_telem_missing": ("ESC telemetry missing", ""),
    "check_escs_offline": ("ESC {0} offline", "B"),
    "check_escs_fault": ("ESC {0} fault", "B"),
    "check_failure_detector_roll": ("Attitude failure detected", ""),
    "check_failure_detector_pitch": ("Attitude failure detected", ""),
    "check_failure_detector_alt": ("Altitude failure detected", ""),
    "check_failure_detector_arm_esc": ("ESC failure", ""),
    "check_failure_detector_motor": ("Motor failure detected", ""),
    "check_failure_detector_imbalanced_prop": ("Imbalanced propeller detected", ""),
    "check_man_control_kill_engaged": ("Kill switch engaged", ""),
    "check_man_control_rtl_engaged": ("RTL switch engaged", ""),
    "check_rc_dl_no_dllink": ("No connection to the ground control station", ""),
    "check_missing_fmu_sdcard": ("Missing FMU SD Card", ""),
    "check_hardfault_present": ("Crash dumps present on SD card", ""),
    "check_system_flight_term_active": ("Flight termination active", ""),
    "check_system_usb_connected": ("USB connected", ""),
    "check_system_no_global_pos": ("Global position estimate required", ""),
    "check_system_no_home_pos": ("Home position required", ""),
    "check_system_safety_button": ("Press safety button first", ""),
    "check_system_arm_auth_failed": ("Arm authorization denied", ""),
    "check_armable_configuration": ("Vehicle is in safety configuration", ""),
}
# PX4 lists all modes for these checks; they block OFFBOARD only from severity ERROR on
_OPTIONAL = {"check_modes_manual_control", "check_rc_dl_no_dllink"}

_ACTIONS = (
    "none",
    "warning",
    "Position mode",
    "Altitude mode",
    "Stabilized mode",
    "Hold",
    "RTL",
    "Land",
    "Descend",
    "disarm",
    "terminate",
)
_CAUSES = (
    "generic",
    "Manual control loss",
    "GCS connection loss",
    "Low battery level",
    "Critical battery level",
    "Emergency battery level",
    "Remaining flight time low",
)

# other events: name → text, struct format of the arguments
OTHERS: dict[str, tuple[str, str]] = {
    "commander_arm_denied_resolve_failures": (
        "Arming denied: Resolve system health failures first",
        "",
    ),
    "commander_arm_denied_calibrating": ("Arming denied: calibrating", ""),
    "commander_arm_denied_throttle_center": ("Arming denied: throttle above center", ""),
    "commander_arm_denied_throttle_high": ("Arming denied: high throttle", ""),
    "commander_arm_denied_not_manual": ("Arming denied: switch to manual mode first", ""),
    "commander_disarm_denied_not_landed": ("Disarming denied: not landed", ""),
    "commander_modeswitch_not_avail": ("Switching to the mode is currently not possible", ""),
    "commander_kill_sw_engaged": ("Kill engaged", ""),
    "commander_failsafe_enter_generic_hold": (
        "Failsafe activated: switching to {action} in {2} seconds",
        "IBH",
    ),
    "commander_failsafe_enter_hold": ("{cause}: switching to {action} in {2} seconds", "IBHB"),
    "commander_failsafe_enter_autopilot_disengaged": (
        "Failsafe activated: Autopilot disengaged, switching to {action}",
        "IB",
    ),
    "commander_failsafe_enter_generic": ("Failsafe activated: switching to {action}", "IB"),
    "commander_failsafe_enter": ("{cause}: switching to {action}", "IBB"),
    "commander_failsafe_enter_crit_bat_warn": ("Critical battery level, land now", ""),
    "commander_failsafe_enter_crit_low_bat_warn": ("Emergency battery level, land immediately", ""),
    "check_estimator_gnss_fusion_stopped": ("GNSS data fusion stopped", ""),
    "commander_mission_comp_lost": ("Connection to mission computer lost", ""),
    "commander_rc_override": ("Pilot took over using sticks", ""),
    "failsafe_rc_override": ("Pilot took over using sticks", ""),
}
_RAISED = {"commander_rc_override", "failsafe_rc_override"}  # severity INFO in PX4, WARNING here


def event_id(name: str) -> int:
    """Return the id of an autopilot event: 24 low bits of FNV-1a(name), component in the high 8."""
    value = 0x811C9DC5
    for byte in name.encode():
        value = (value ^ byte) * 0x1000193 & 0xFFFFFFFF
    return value & 0xFFFFFF | _AUTOPILOT


_NAMES = {event_id(name): name for name in (*CHECKS, *OTHERS, SUMMARY, HEALTH_SUMMARY)}


class EventReader:
    """Converts EVENT messages to text; stores whether the last summary excludes OFFBOARD."""

    def __init__(self) -> None:
        self._blocked = False
        self._last: int | None = None

    def read(self, message: EventMessage) -> tuple[int, str] | None:
        """Return severity (MAV_SEVERITY) and text; None for events without a text here."""
        if message.sequence == self._last:  # repeated event
            return None
        self._last = message.sequence
        name = _NAMES.get(message.event, "")
        arguments = bytes(message.arguments).ljust(ARGUMENTS, b"\0")
        severity = message.log_levels & 0xF
        if name == SUMMARY:
            _, _, _, can_arm, _ = struct.unpack_from("<BIIII", arguments)
            self._blocked = not can_arm & OFFBOARD
        elif name in CHECKS:
            return self._check(name, severity, arguments)
        elif name in OTHERS:
            text, layout = OTHERS[name]
            if name in _RAISED:
                severity = min(severity, Severity.WARNING)
            return severity, _failsafe_text(text, struct.unpack_from("<" + layout, arguments))
        elif severity <= Severity.ERROR:
            return severity, f"event {message.event:#010x} has no text here: see PX4's log"
        return None

    def _check(self, name: str, severity: int, arguments: bytes) -> tuple[int, str] | None:
        text, layout = CHECKS[name]
        modes, _component, *values = struct.unpack_from("<IB" + layout, arguments)
        if not self._blocked or not modes & OFFBOARD:
            return None
        if name in _OPTIONAL and severity > Severity.ERROR:
            return None
        # blocks arming: at least WARNING, also where PX4 sends INFO
        return min(severity, Severity.WARNING), text.format(*values)


def _failsafe_text(text: str, values: tuple[int, ...]) -> str:
    action = _word(_ACTIONS, values[1]) if len(values) > 1 else ""
    cause = _word(_CAUSES, values[-1]) if "{cause}" in text else ""
    return text.format(*values, action=action, cause=cause)


def _word(words: tuple[str, ...], index: int) -> str:
    return words[index] if index < len(words) else str(index)
