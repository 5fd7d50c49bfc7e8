"""The arm's driver: efforts or goal positions to the servos, angles back, once per cycle.

Plain object without ROS. `cycle` does one exchange with the servos; the caller paces it. Commands
may come from another thread.

When a servo is lost, `cycle` returns no reading, so that the joint angles stop and the supervisor
reacts to their age; the other servos get zero current. After a lost device the driver opens it
again by itself.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from uam_control.vehicle import CURRENT_SERVO, POSITION_SERVO
from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel import startup
from uam_sim_bridge.devices.dynamixel.budget import GRIPPER_GOAL, Budget, budget
from uam_sim_bridge.devices.dynamixel.bus import BusLost, DynamixelBus, NoAnswer, Refused, tried
from uam_sim_bridge.devices.dynamixel.chain import GRIPPER, ArmChain, ArmError, ServoDescription
from uam_sim_bridge.devices.dynamixel.health import CycleMeter, ServoHealth
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.devices.dynamixel.upkeep import Upkeep
from uam_sim_bridge.devices.serial.serial_port import SerialPort, advice, latency_timer

STATE = (names.PRESENT_POSITION, names.PRESENT_VELOCITY, names.PRESENT_CURRENT)
START_ANSWER = 0.3  # [s] for each answer before the first cycle: the computer is busy then
NEEDED_LATENCY = 0.001  # [s] of the adapter's timer


@dataclass(frozen=True)
class Reading:
    """State of the joints at a time."""

    time: float  # [s]
    position: np.ndarray  # (n,) [rad]
    velocity: np.ndarray  # (n,) [rad/s]
    effort: np.ndarray  # (n,) [N m] of the motors
    grip: np.ndarray  # (2,) opening [m], closing force [N] of a gripper, NaN without an answer


@dataclass(frozen=True)
class Command:
    """Efforts (n,) [N m] or goals (n,) [rad], desired velocities (n,) [rad/s], time [s]."""

    values: np.ndarray
    velocity: np.ndarray
    time: float


class ArmDriver:
    """Drives a chain of servos.

    `health` (n,): per servo, base to tip; `remarks`: of the start, one line each; `stale`: no
    command within effort_timeout; `saturated`: commands cut to the current limit; `released`: the
    joints can be moved by hand, see `release`;
    `device_problem`: of a lost device, one line; `start_angles` (n,): as read by `start` [rad].
    """

    def __init__(
        self,
        chain: ArmChain,
        parameters: ArmDriverParameters,
        servo_mode: str = CURRENT_SERVO,
        control_period: float = 0.004,
        position_p_gain: float = 800.0,
        clock: Callable[[], float] = time.monotonic,
        port: SerialPort | None = None,
    ) -> None:
        """servo_mode: of the vehicle's `servos`; control_period [s]; position_p_gain: of position
        mode, register value; clock: seconds; port: see `DynamixelBus`. Raises ArmError."""
        self.chain, self.parameters = chain, parameters
        self.rate = parameters.rate or 1.0 / control_period  # [Hz]
        self.in_position_mode = servo_mode == POSITION_SERVO
        self._mode, self._clock = startup.required_mode(servo_mode), clock
        self._span = _common_span(chain)
        if self.in_position_mode:
            startup.check_turn(chain)
        self.latency_timer = latency_timer(chain.device)
        wait = parameters.answer_timeout + 2.0 * (self.latency_timer or 0.0) + chain.return_delay
        self.bus = DynamixelBus(chain.device, chain.baud_rate, wait, port)
        self._upkeep = Upkeep(
            self.bus, chain, parameters, position_p_gain if self.in_position_mode else None
        )
        self.health = self._upkeep.health
        self.meter = CycleMeter()
        self.remarks, self.start_angles = list[str](), list[float]()
        self.device_problem, self.stale, self.saturated = "", True, 0
        self.released = False
        self._fast, self._open = parameters.fast_sync_read, False
        self._lock = threading.RLock()
        self._command: Command | None = None
        self._opening = math.nan  # [m] goal of the gripper
        self._reading: Reading | None = None
        self._next_open, self._last_cycle = -math.inf, math.nan

    @property
    def budget(self) -> Budget:
        """The time budget of a cycle with these parameters."""
        found = budget(
            servos=len(self.chain.servos),
            baud_rate=self.chain.baud_rate,
            return_delay=self.chain.return_delay,
            latency_timer=self.latency_timer or 0.0,
            fast=self._fast,
            slow_every=max(1, round(self.parameters.slow_interval * self.rate)),
            goal=4 if self.in_position_mode else 2,
        )
        further = () if self.chain.gripper is None else (GRIPPER_GOAL,)
        return replace(found, items=(*found.items, *further))

    @property
    def lost(self) -> list[ServoHealth]:
        """The servos of the arm that do not answer."""
        return [one for one in self.health if one.lost and one.joint != GRIPPER]

    @property
    def problems(self) -> list[str]:
        """What is wrong now, one line each."""
        found = [self.device_problem] if self.device_problem else []
        return found + [one.problem for one in self.health if one.problem]

    def start(self) -> None:
        """Open the device, check servos, settings and pose, and fill `remarks`; no torque yet.

        Raises ArmError (wrong servos or settings, a servo that falls silent), BusLost; the device
        is closed then.
        """
        self._fast = self.parameters.fast_sync_read
        try:
            with self.bus.patient(START_ANSWER):
                self._check()
        except (ArmError, BusLost, NoAnswer) as error:
            self.bus.close()
            if isinstance(error, NoAnswer):
                raise ArmError(f"{self.chain.device}: {error}") from None
            raise
        self._open = True

    def _check(self) -> None:
        bus, chain, p = self.bus, self.chain, self.parameters
        bus.open()
        startup.check_servos(bus, chain)
        self.remarks = startup.check_settings(bus, chain, self._mode, p.write_settings)
        if self._fast and (old := startup.without_fast_sync_read(bus, chain)):
            self._fast = False
            self.remarks += old
        self.remarks += self._timing_remarks()
        counts = []
        for servo, health in zip(chain.servos, self.health, strict=True):
            health.error = tried(bus.read, servo.id, servo.table[names.HARDWARE_ERROR])
            if servo.joint == GRIPPER:
                continue
            at = servo.table[names.PRESENT_POSITION]
            counts.append(tried(bus.read_signed, servo.id, at))
        self.start_angles = startup.angles(chain, counts)
        stowed = [servo.stowed for servo in chain.arm]
        self.remarks += startup.pose_findings(chain, counts, stowed, p.pose_tolerance)
        self.remarks += [health.problem for health in self.health if health.problem]

    def command_effort(self, effort: np.ndarray, velocity: np.ndarray | None = None) -> None:
        """Take joint efforts (n,) [N m]; velocity (n,) [rad/s]: desired, for the friction."""
        velocity = np.zeros(len(effort)) if velocity is None else np.array(velocity, dtype=float)
        self._command = Command(np.array(effort, dtype=float), velocity, self._clock())

    def command_position(self, goal: np.ndarray) -> None:
        """Take goal positions (n,) [rad]; NaN: none yet."""
        self._command = Command(np.array(goal, dtype=float), np.zeros(len(goal)), self._clock())

    def command_gripper(self, opening: float) -> None:
        """Take the goal of the gripper: opening [m], within its stroke."""
        self._opening = opening

    def cycle(self) -> Reading | None:
        """Write the goals and read the states; None if not every servo answered.

        The first cycle switches the torque on. Raises nothing: a lost device is opened again every
        `reopen_interval`.
        """
        with self._lock:
            begun = self._clock()
            if not self._open and not self._reopen(begun):
                return None
            try:
                if 0.0 < self.parameters.watchdog < begun - self._last_cycle:
                    self._upkeep.check_watchdogs()
                self._last_cycle = begun
                self._write_goals(begun)
                reading = self._read_states()
                self._upkeep.read_slowly(begun)
            except BusLost as error:
                self.device_problem = str(error)
                self.bus.close()
                self._open, self._reading = False, None
                self._next_open = self._clock() + self.parameters.reopen_interval
                return None
            self.meter.add(begun, self._clock())
            return reading

    def reboot(self) -> list[str]:
        """Restart the servos with a hardware error; return one line each.

        A servo restarts for about half a second without torque and without an answer.
        """
        with self._lock:
            try:
                return self._upkeep.reboot()
            except BusLost as error:
                return [str(error)]

    def release(self, released: bool) -> str:
        """Let the joints be moved by hand, or drive them again; return what failed, "" if nothing.

        Current mode: zero current. Position mode: torque off, for the servo's own loop resists.
        """
        with self._lock:
            self.released = released
            if not (released and self.in_position_mode and self._open):
                return ""
            problems = []
            for servo in self.chain.arm:
                try:
                    tried(self.bus.write, servo.id, servo.table[names.TORQUE_ENABLE], 0)
                except (NoAnswer, Refused, BusLost) as error:
                    problems.append(f"{servo.label}: {error}")
                self._upkeep.unprepared.add(servo.id)
            return "; ".join(problems)

    def stop(self) -> None:
        """End as configured, torque off or holding, and close the device."""
        with self._lock:
            for servo in self.chain.servos if self._open else ():
                try:
                    self._upkeep.end(servo)
                except (NoAnswer, Refused, BusLost) as error:
                    self.remarks.append(f"{servo.label}: not ended: {error}")
            self._open = False
            self.bus.close()

    def _timing_remarks(self) -> list[str]:
        found, device = [], self.chain.device
        if self.latency_timer is not None and self.latency_timer > NEEDED_LATENCY:
            found.append(
                f"{device}: latency timer {1e3 * self.latency_timer:g} ms, 1 ms is needed: "
                f"{advice(device)}"
            )
        if self.budget.rate < self.rate:
            found.append(
                f"{device}: the bus carries {self.budget.rate:.0f} Hz, {self.rate:g} Hz is needed"
            )
        return found

    def _write_goals(self, now: float) -> None:
        """Write the goal of every servo that has torque."""
        command, reading = self._command, self._reading
        self.stale = command is None or now - command.time > self.parameters.effort_timeout
        unprepared, turns = self._upkeep.unprepared, self._upkeep.turns
        ready = [pair for pair in enumerate(self.chain.arm) if pair[1].id not in unprepared]
        if self.in_position_mode:
            register, goals = names.GOAL_POSITION, {}
            for i, servo in ready if command is not None else ():
                goal = goal_position(servo, command.values[i], turns[i])
                if goal is not None:
                    goals[servo.id] = goal
        else:
            register, goals = names.GOAL_CURRENT, dict.fromkeys((one.id for _, one in ready), 0)
            if not (self.stale or self.lost or self.released or reading is None):
                for i, servo in ready:
                    goals[servo.id] = self._goal_current(servo, command, i, reading.position[i])
        if goals:
            self.bus.sync_write(self.chain.servos[0].table[register], goals)
        hand = self.chain.gripper
        if hand is not None and hand.id not in unprepared and math.isfinite(self._opening):
            angle = self._opening / self.chain.transmission
            goal = goal_position(hand, angle, turns[len(self.chain.arm)])
            self.bus.sync_write(hand.table[names.GOAL_POSITION], {hand.id: goal})

    def _goal_current(self, servo: ServoDescription, command: Command, i: int, angle: float) -> int:
        effort, velocity = float(command.values[i]), float(command.velocity[i])
        raw = goal_current(servo, effort, velocity, angle, self.parameters)
        self.saturated += abs(raw) >= servo.current_limit_counts
        return raw

    def _read_states(self) -> Reading | None:
        """Read every servo; one that misses the common read is read alone."""
        ids = self.chain.ids
        lost = {ids[i] for i, one in enumerate(self.health) if one.lost}
        begun = self._clock()
        last = sorted(ids, key=lambda one: one in lost)  # a silent servo stops those behind it
        found = self.bus.sync_read(self._span, last, self._fast and not lost)
        for servo in ids:
            if servo not in found:
                try:
                    found[servo] = self.bus.read_bytes(servo, self._span)
                except (NoAnswer, Refused):
                    continue
        taken = 0.5 * (begun + self._clock())
        for i, servo in enumerate(ids):
            self._upkeep.count(i, servo in found)
        if any(servo.id not in found for servo in self.chain.arm):
            return None
        rows = []
        for i, servo in enumerate(self.chain.servos):
            if servo.id not in found:
                rows.append((math.nan, math.nan, math.nan))
                continue
            counts, speed, current = self._decoded(servo, found[servo.id])
            if servo.id in self._upkeep.unprepared and not self.released:
                self._upkeep.prepare(i, counts)
            angle = servo.angle(counts + self._upkeep.turns[i])
            rows.append((angle, servo.velocity(speed), servo.effort(current)))
        count, lever = len(self.chain.arm), self.chain.transmission
        values, grip = np.array(rows, dtype=float).T, np.full(2, math.nan)
        if self.chain.gripper is not None:
            angle, _, torque = values[:, count]
            grip[:] = angle * lever, -torque / lever
        self._reading = Reading(taken, *values[:, :count], grip)
        return self._reading

    def _decoded(self, servo: ServoDescription, data: bytes) -> list[int]:
        """Return the registers of STATE in the bytes of a common read."""
        parts = (servo.table[name].of(data, self._span.address) for name in STATE)
        return [int.from_bytes(part, "little", signed=True) for part in parts]

    def _reopen(self, now: float) -> bool:
        if now < self._next_open:
            return False
        self._next_open = now + self.parameters.reopen_interval
        try:
            self.bus.open()
        except BusLost as error:
            self.device_problem = str(error)
            return False
        self.device_problem, self._open = "", True
        self._upkeep.forget()
        return True


def _common_span(chain: ArmChain) -> names.Register:
    """Return where the states are in every servo's table. Raises ArmError if they differ."""
    spans = {servo.table.span(*STATE) for servo in chain.servos}
    goals = {servo.table[names.GOAL_CURRENT] for servo in chain.servos}
    if len(spans) > 1 or len(goals) > 1:
        models = ", ".join(sorted({servo.table.model for servo in chain.servos}))
        raise ArmError(f"{chain.device}: {models}: control tables differ, one chain needs one kind")
    return spans.pop()


def friction_torque(coulomb: float, viscous: float, velocity: float, speed: float) -> float:
    """Return the friction torque [N m] at a desired velocity [rad/s].

    coulomb [N m]; viscous [N m s/rad]; speed [rad/s]: width of the smooth sign, tanh(velocity /
    speed), which has no step when the desired velocity changes its sign.
    """
    return coulomb * math.tanh(velocity / speed) + viscous * velocity


def goal_current(
    servo: ServoDescription,
    effort: float,
    velocity: float,
    angle: float,
    parameters: ArmDriverParameters,
) -> int:
    """Return the register Goal Current of a joint.

    effort [N m]; velocity [rad/s]: desired; angle [rad]: measured. An effort that drives further
    into a limit of the angle is removed.
    """
    if parameters.friction_compensation:
        effort += friction_torque(servo.coulomb, servo.viscous, velocity, parameters.friction_speed)
    if (angle >= servo.high and effort > 0.0) or (angle <= servo.low and effort < 0.0):
        return 0
    return servo.current(effort)


def goal_position(servo: ServoDescription, goal: float, turns: int) -> int | None:
    """Return the register Goal Position of a goal [rad] within the limits; None for NaN.

    turns [counts]: see `ServoDescription.turned`.
    """
    if math.isnan(goal):
        return None
    return servo.counts(min(max(goal, servo.low), servo.high)) - turns
