"""Checks before torque: are these the described servos, with the required settings and angles?

Each problem is one line. What the bus cannot show is the sign of a joint that is stowed at 0, and
two servos of one model swapped at equal angles: those are checked by hand (docs/hardware.md).
"""

import math
from collections.abc import Iterator, Sequence
from itertools import permutations, product

from uam_control.vehicle import POSITION_SERVO
from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel.bus import DynamixelBus, NoAnswer, Refused, tried
from uam_sim_bridge.devices.dynamixel.chain import SPEEDS, ArmChain, ArmError, ServoDescription
from uam_sim_bridge.devices.dynamixel.control_table import MODE_NAMES, model_name

FAST_FIRMWARE = 45  # first one with Fast Sync Read
DRIVE_MODE_FORBIDDEN = {0: "reverse direction", 3: "torque on by a goal"}  # bits
ALL_STATUS = 2  # Status Return Level


def required_mode(servo_mode: str) -> int:
    """Return the Operating Mode for a mode of the vehicle's servos."""
    return names.POSITION_MODE if servo_mode == POSITION_SERVO else names.CURRENT_MODE


def check_servos(bus: DynamixelBus, chain: ArmChain) -> None:
    """Check that every id answers with the described model.

    Raises ArmError with every problem, separated by semicolons; BusLost.
    """
    problems, silent, others = [], [], {}
    for servo in chain.servos:
        try:
            number = tried(bus.ping, servo.id)
        except NoAnswer as error:
            silent.append((servo, error.damaged))
            continue
        if number != servo.table.number:
            problems.append(
                f"{servo.label}: is a {model_name(number)}, {servo.table.model} is described"
            )
            others[servo.joint] = number
    if len(others) > 1 and sorted(others.values()) == sorted(
        servo.table.number for servo in chain.servos if servo.joint in others
    ):
        problems.append(f"the models fit if {' and '.join(others)} are swapped")
    found = bus.scan() if silent else {}
    for servo, damaged in silent:
        if damaged:
            reason = "damaged answers: two servos with this id, a bad cable, or another baud rate"
        else:
            reason = f"no answer at {chain.baud_rate} baud"
        problems.append(f"{servo.label}: {reason}")
    if silent:
        listed = ", ".join(f"{one} ({model_name(found[one][0])})" for one in found) or "none"
        problems.append(f"ids on the bus: {listed}")
        if not found and (elsewhere := _other_baud_rates(bus, chain)):
            problems.append(elsewhere)
    if problems:
        raise ArmError(f"{chain.device}: {'; '.join(problems)}")


def _other_baud_rates(bus: DynamixelBus, chain: ArmChain) -> str:
    """Return at which baud rates the described ids answer, "" if nowhere."""
    texts = []
    for speed in SPEEDS:
        if speed == chain.baud_rate:
            continue
        bus.set_baud_rate(speed)
        for servo in chain.ids:
            try:
                bus.ping(servo)
            except NoAnswer:
                continue
            texts.append(f"id {servo} answers at {speed} baud")
    bus.set_baud_rate(chain.baud_rate)
    return ", ".join(texts)


def check_settings(bus: DynamixelBus, chain: ArmChain, mode: int, write: bool) -> list[str]:
    """Check the settings of every servo, torque off; return remarks, one line each.

    write: change those that differ and remark it; else they are problems. Raises ArmError with
    every problem, separated by semicolons; NoAnswer, BusLost.
    """
    remarks, problems = [], []
    for servo in chain.servos:
        drive = tried(bus.read, servo.id, servo.table[names.DRIVE_MODE])
        for bit, meaning in DRIVE_MODE_FORBIDDEN.items():
            if drive & 1 << bit:
                problems.append(
                    f"{servo.label}: Drive Mode {drive} ({meaning}): write 0; a direction belongs "
                    "into the hardware file"
                )
        for name, value, meaning in _settings(servo, chain, mode):
            register = servo.table[name]
            present = tried(bus.read, servo.id, register)
            if present == value:
                continue
            was = _shown(name, present)
            if not write:
                problems.append(
                    f"{servo.label}: {name} is {was}, {_shown(name, value)} is needed ({meaning}); "
                    "write_settings: true writes it"
                )
                continue
            try:
                if tried(bus.read, servo.id, servo.table[names.TORQUE_ENABLE]):
                    tried(bus.write, servo.id, servo.table[names.TORQUE_ENABLE], 0)
                tried(bus.write, servo.id, register, value)
            except Refused as error:
                problems.append(f"{servo.label}: {name} {_shown(name, value)}: {error}")
                continue
            remarks.append(f"{servo.label}: {name} was {was}, is now {_shown(name, value)}")
    if problems:
        raise ArmError(f"{chain.device}: {'; '.join(problems)}")
    return remarks


def _settings(
    servo: ServoDescription, chain: ArmChain, mode: int
) -> Iterator[tuple[str, int, str]]:
    """Yield (register, required value, reason)."""
    yield names.STATUS_LEVEL, ALL_STATUS, "the driver reads the errors of every write"
    yield names.RETURN_DELAY, chain.return_delay_counts, "part of the bus budget"
    own = mode if servo.mode is None else servo.mode
    yield names.OPERATING_MODE, own, "servos.mode of the vehicle, a gripper's position mode"
    yield names.CURRENT_LIMIT, servo.current_limit_counts, "current_limit of the hardware file"


def _shown(name: str, value: int) -> str:
    if name == names.OPERATING_MODE:
        return f"{value} ({MODE_NAMES.get(value, 'unknown')})"
    return str(value)


def without_fast_sync_read(bus: DynamixelBus, chain: ArmChain) -> list[str]:
    """Return one line per servo whose firmware has no Fast Sync Read."""
    found = []
    for servo in chain.servos:
        firmware = tried(bus.read, servo.id, servo.table[names.FIRMWARE])
        if firmware < FAST_FIRMWARE:
            found.append(
                f"{servo.label}: firmware {firmware} has no Fast Sync Read ({FAST_FIRMWARE} "
                "needed): Sync Read is used"
            )
    return found


def check_turn(chain: ArmChain) -> None:
    """Raise ArmError for a joint whose range is not within one turn of its servo."""
    for servo in chain.servos:
        ends = sorted((servo.counts(servo.low), servo.counts(servo.high)))
        last = servo.table.counts_per_turn - 1
        if ends[0] < 0 or ends[1] > last:
            raise ArmError(
                f"{servo.label}: its range is {ends[0]} to {ends[1]} counts, position mode has 0 "
                f"to {last}: mount the horn so that zero is near {(last + 1) // 2}"
            )


def angles(chain: ArmChain, counts: Sequence[int]) -> list[float]:
    """Return the joint angles (n,) [rad] at positions (n,) [counts] within one turn."""
    return [_angle(servo, count) for servo, count in zip(chain.arm, counts, strict=True)]


def pose_findings(
    chain: ArmChain, counts: Sequence[int], stowed: Sequence[float], tolerance: float
) -> list[str]:
    """Return what is suspicious about the angles at the start, one line each.

    counts (n,): positions as read; stowed (n,) [rad]: angles at which the arm should be. Angles
    that would fit with servos swapped or a direction reversed are named as such.
    """
    servos = chain.arm
    measured = angles(chain, counts)
    pairs = list(zip(servos, measured, strict=True))
    found = [
        f"{servo.label}: {math.degrees(angle):.0f} deg is outside its range "
        f"{math.degrees(servo.low):.0f} to {math.degrees(servo.high):.0f}: wrong zero or direction?"
        for servo, angle in pairs
        if not servo.low <= angle <= servo.high
    ]
    if all(abs(a - s) <= tolerance for a, s in zip(measured, stowed, strict=True)):
        return found
    shown = ", ".join(f"{servo.joint} {math.degrees(angle):.0f}" for servo, angle in pairs)
    text = f"the arm is not stowed: {shown} deg"
    if reason := _explanation(servos, counts, stowed, tolerance):
        text += f"; the angles fit if {reason}"
    return [*found, text]


def _explanation(
    servos: Sequence[ServoDescription],
    counts: Sequence[int],
    stowed: Sequence[float],
    tolerance: float,
) -> str:
    """Return the mistake with the fewest parts that explains the angles, "" if there is none."""
    best: tuple[int, str] | None = None
    count = len(servos)
    for order in permutations(range(count)) if count <= 4 else [tuple(range(count))]:
        for signs in product((1, -1), repeat=count):
            moved = [i for i in range(count) if order[i] != i]
            turned = [i for i in range(count) if signs[i] < 0]
            tried_angles = [signs[i] * _angle(servos[i], counts[order[i]]) for i in range(count)]
            if any(abs(a - s) > tolerance for a, s in zip(tried_angles, stowed, strict=True)):
                continue
            parts = []
            if moved:
                parts.append(f"ids {' and '.join(str(servos[i].id) for i in moved)} are swapped")
            parts += [f"the direction of {servos[i].joint} is reversed" for i in turned]
            cost = len(moved) + len(turned)
            if best is None or cost < best[0]:
                best = cost, " and ".join(parts)
    return best[1] if best else ""


def _angle(servo: ServoDescription, counts: int) -> float:
    return servo.angle(counts + servo.turned(counts))
