"""The automatic items: functions of an observation."""

import math
from collections.abc import Iterator

import numpy as np

from uam_control.supervision import PreflightCheck
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters
from uam_lab.preflight.checklist.observation import BAD, Box, Observation
from uam_lab.preflight.checklist.step import UNKNOWN, at_least, at_most

ARM_DRIVER, RECORDER = "arm_driver", "recorder"
KILL_SWITCH = "RC_MAP_KILL_SW"  # PX4: channel of the kill switch
OWN_LINE = "checklist"  # of the pre-arm report: this list itself
GIGABYTE = 1e9
ROOM_TOLERANCE = 1e-6  # [m]


def automatic(seen: Observation, limits: ChecklistParameters) -> tuple[PreflightCheck, ...]:
    """Return the findings of all automatic items."""
    return (
        nodes(seen, limits),
        *motion_capture(seen, limits),
        *inertial(seen, limits),
        *arm(seen, limits),
        *autopilot(seen, limits),
        *room(seen, limits),
        *computer(seen, limits),
        recording(seen),
        pre_arm(seen),
    )


def nodes(seen: Observation, limits: ChecklistParameters) -> PreflightCheck:
    """Every expected node reports, and none reports an error."""
    found = []
    for name in seen.expected:
        report = seen.nodes.get(name)
        if report is None:
            found.append(f"{name}: no diagnostics")
        elif report.age > limits.node_silence:
            found.append(f"{name}: silent for {report.age:.0f} s")
        elif report.level == BAD:
            found.append(f"{name}: {report.summary}")
    value = "; ".join(found) or f"{len(seen.expected)} alive"
    limit = f"no error, silent for at most {limits.node_silence:.3g} s"
    return PreflightCheck("nodes", value, limit, not found)


def motion_capture(seen: Observation, limits: ChecklistParameters) -> Iterator[PreflightCheck]:
    """Rate, age, losses of the poses; level; at rest."""
    stream, rest = seen.mocap, seen.resting
    yield at_least("mocap rate", stream and stream.rate, limits.mocap_rate, "Hz")
    yield at_most("mocap latency", _milli(seen.pose_age), 1e3 * limits.mocap_latency, "ms")
    yield at_most("mocap losses", stream and 100.0 * stream.loss, 100.0 * limits.mocap_loss, "%")
    yield at_most("mocap gap", _milli(stream and stream.gap), 1e3 * limits.mocap_gap, "ms")
    yield at_most("mocap level", rest and rest.tilt, limits.level, "rad", standing=True)
    yield at_most("at rest", rest and rest.spread, limits.spread_rest, "m", standing=True)


def inertial(seen: Observation, limits: ChecklistParameters) -> Iterator[PreflightCheck]:
    """Rate of the IMU; its vertical agrees with that of motion capture; at rest."""
    rest, stream = seen.resting, seen.imu
    least = limits.imu_rate * seen.control_rate
    yield at_least("IMU rate", stream and stream.rate, least, "Hz")
    angle = rest and rest.gravity_angle
    yield at_most("mocap and IMU vertical", angle, limits.gravity_angle, "rad", standing=True)
    error = rest and abs(rest.force - seen.gravity)
    yield at_most("gravity", error, limits.gravity_size, "m/s^2", standing=True)
    yield at_most("gyro at rest", rest and rest.rate, limits.gyro_rest, "rad/s", standing=True)


def arm(seen: Observation, limits: ChecklistParameters) -> Iterator[PreflightCheck]:
    """Joint states, stowed pose, temperatures and errors of the servos."""
    stream, rest = seen.joint_states, seen.resting
    least = limits.joint_rate * seen.control_rate
    yield at_least("joint state rate", stream and stream.rate, least, "Hz")
    away = np.abs(rest.joints - seen.stowed) if rest is not None else None
    worst = None if away is None else float(np.max(away, initial=0.0))
    found = at_most("joints at stow", worst, limits.stow_error, "rad", standing=True)
    if away is not None and not found.passed:
        name = seen.joint_names[int(np.argmax(away))]
        found = PreflightCheck(found.name, f"{name} {found.value} away", found.limit, False, True)
    yield found
    if ARM_DRIVER not in seen.expected:
        return
    missing = [name for name in seen.joint_names if name not in seen.temperatures]
    hottest = None if missing else max(seen.temperatures.values(), default=None)
    yield at_most("servo temperature", hottest, limits.servo_temperature, "deg C")
    yield _servo_errors(seen)


def _servo_errors(seen: Observation) -> PreflightCheck:
    report = seen.nodes.get(ARM_DRIVER)
    if report is None:
        return PreflightCheck("servo errors", UNKNOWN, "none", False)
    errors = [
        f"{key.removesuffix(' error')}: {value}"
        for key, value in report.values.items()
        if key.endswith(" error") and value
    ]
    return PreflightCheck("servo errors", "; ".join(errors) or "none", "none", not errors)


def autopilot(seen: Observation, limits: ChecklistParameters) -> Iterator[PreflightCheck]:
    """Link, battery, parameters, kill switch and radio of the autopilot."""
    state = "connected" if seen.connected else "no heartbeat"
    yield PreflightCheck("autopilot", state, "connected", seen.connected)
    charge = None if math.isnan(seen.battery) else 100.0 * seen.battery
    yield at_least("battery", charge, 100.0 * limits.battery, "%")
    kill = [line for line in seen.differences if line.startswith(KILL_SWITCH)]
    others = [line for line in seen.differences if line not in kill]
    read = bool(seen.parameters_read)
    waiting = UNKNOWN if seen.parameters_read is None else "being read"
    value = "; ".join(others) or ("as required" if read else waiting)
    yield PreflightCheck("PX4 parameters", value, "as required of a vehicle", read and not others)
    value = "; ".join(kill) or ("mapped" if read else waiting)
    yield PreflightCheck("kill switch mapped", value, f"{KILL_SWITCH} set", read and not kill)
    if seen.killed:
        yield PreflightCheck("kill switch", "engaged", "released", False)
    if limits.radio:
        value = {None: UNKNOWN, True: "received", False: "not received"}[seen.radio]
        yield PreflightCheck("radio", value, "received", bool(seen.radio))


def room(seen: Observation, limits: ChecklistParameters) -> Iterator[PreflightCheck]:
    """The supervisor's geofence is inside the room, and the vehicle inside the geofence."""
    fence, inside = seen.fence, seen.room
    if fence is None:
        yield PreflightCheck("geofence", UNKNOWN, "the room of the lab file", False)
        return
    shown = _box_text(fence)
    if inside is None:
        yield PreflightCheck("geofence", shown, "no room given", True)
    else:
        fits = all(
            a >= b - ROOM_TOLERANCE for a, b in zip(fence.low, inside.low, strict=True)
        ) and all(a <= b + ROOM_TOLERANCE for a, b in zip(fence.high, inside.high, strict=True))
        yield PreflightCheck("geofence", shown, f"inside the room {_box_text(inside)}", fits)
    yield _inside_fence(seen, limits)


def _inside_fence(seen: Observation, limits: ChecklistParameters) -> PreflightCheck:
    """Return the least distance to the sides of the fence; below only the floor counts."""
    name, margin = "inside geofence", limits.room_margin
    if seen.resting is None:
        return PreflightCheck(name, UNKNOWN, f"at least {margin:.3g} m inside", False, True)
    place = seen.resting.position
    low, high = np.array(seen.fence.low), np.array(seen.fence.high)
    sides = np.minimum(place - low, high - place)
    distance = min(float(sides[0]), float(sides[1]), float(high[2] - place[2]))
    above_floor = bool(place[2] >= low[2])
    value = f"{distance:.2f} m at " + ", ".join(f"{one:.2f}" for one in place)
    value += "" if above_floor else ", below its floor"
    passed = distance >= margin and above_floor
    return PreflightCheck(name, value, f"at least {margin:.3g} m inside", passed, True)


def computer(seen: Observation, limits: ChecklistParameters) -> Iterator[PreflightCheck]:
    """Disk, clock, governor and real-time limits of the companion computer."""
    host = seen.host
    free = None if host.disk is None else host.disk / GIGABYTE
    yield at_least("disk", free, limits.disk, "GB")
    if limits.clock_synchronised:
        words = {None: UNKNOWN, True: "synchronised", False: "not synchronised"}
        value = words[host.synchronised]
        yield PreflightCheck("clock", value, "synchronised", bool(host.synchronised))
    jump, limit = 1e3 * abs(host.jump), 1e3 * limits.clock_jump
    yield at_most("clock steps", jump, limit, "ms")
    if limits.performance_governor:
        value = ", ".join(dict.fromkeys(host.governors)) or "no frequency scaling"
        passed = all(one == "performance" for one in host.governors)
        yield PreflightCheck("CPU governor", value, "performance", passed)
    yield at_least("real-time priority", host.rtprio, limits.rtprio, "")


def recording(seen: Observation) -> PreflightCheck:
    """The recorder writes. Single lost messages are shown and do not count."""
    report = seen.nodes.get(RECORDER)
    if report is None:
        return PreflightCheck("recording", UNKNOWN, "running", False)
    return PreflightCheck("recording", report.summary, "running", report.level != BAD)


def pre_arm(seen: Observation) -> PreflightCheck:
    """The mission's own pre-arm report is green."""
    lines = [line for line in seen.preflight if line.name != OWN_LINE]
    failed = [line.text for line in lines if not line.passed]
    value = "; ".join(failed) or ("green" if lines else UNKNOWN)
    return PreflightCheck("pre-arm report", value, "green", bool(lines) and not failed, True)


def _milli(value: float | None) -> float | None:
    return None if value is None else 1e3 * value


def _box_text(box: Box) -> str:
    sides = zip("xyz", box.low, box.high, strict=True)
    return ", ".join(f"{axis} {low:g}..{high:g}" for axis, low, high in sides)
