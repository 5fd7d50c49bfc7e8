"""Health of the autopilot: the flags of ESTIMATOR_STATUS and SYS_STATUS as names and faults.

PX4's EKF2 sets `attitude`, velocity and position flags when these estimates are valid. It sets
`const_pos_mode` without an aiding source (it then assumes zero velocity), and `accel_error` when
vibration degrades the height estimate.
"""

from __future__ import annotations

from uam_sim_bridge.mavlink.protocol.wire import mavlink2


def _names(enum: str, prefix: str) -> dict[int, str]:
    return {
        bit: entry.name.removeprefix(prefix).lower()
        for bit, entry in mavlink2.enums[enum].items()
        if bit & (bit - 1) == 0 and not entry.name.endswith("ENUM_END")
    }


ESTIMATOR_FLAGS = _names("ESTIMATOR_STATUS_FLAGS", "ESTIMATOR_")
SENSORS = {
    bit: name.removeprefix("sensor_")
    for bit, name in _names("MAV_SYS_STATUS_SENSOR", "MAV_SYS_STATUS_").items()
}

ATTITUDE = mavlink2.ESTIMATOR_ATTITUDE
_HORIZONTAL = mavlink2.ESTIMATOR_POS_HORIZ_REL | mavlink2.ESTIMATOR_POS_HORIZ_ABS
_VERTICAL = mavlink2.ESTIMATOR_POS_VERT_ABS | mavlink2.ESTIMATOR_POS_VERT_AGL


def names(flags: int, table: dict[int, str]) -> tuple[str, ...]:
    """Return the names of the bits set in `flags`."""
    return tuple(name for bit, name in table.items() if flags & bit)


def estimate_faults(flags: int) -> tuple[str, ...]:
    """Return one text per fault of the estimate; () if attitude and position are valid.

    flags: ESTIMATOR_STATUS.flags.
    """
    faults = []
    if not flags & ATTITUDE:
        faults.append("no valid attitude estimate")
    if not flags & _HORIZONTAL or flags & mavlink2.ESTIMATOR_CONST_POS_MODE:
        faults.append("no horizontal position estimate")
    if not flags & _VERTICAL:
        faults.append("no height estimate")
    if flags & mavlink2.ESTIMATOR_ACCEL_ERROR:
        faults.append("accelerometer data are bad")
    return tuple(faults)


def unhealthy(present: int, enabled: int, health: int) -> tuple[str, ...]:
    """Return the names of the present, enabled and unhealthy sensors (bit masks of SYS_STATUS)."""
    return names(present & enabled & ~health, SENSORS)
