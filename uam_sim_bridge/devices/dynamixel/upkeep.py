"""Upkeep of the servos beside the control cycle: torque and watchdog on, slow reads, end.

A servo is prepared when it rests at zero goal with torque and watchdog on. One that has restarted,
whose watchdog has tripped, or that answers again is prepared anew. A hardware error keeps it
without torque until a reboot.
"""

import math
from itertools import cycle, product

from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel.bus import BusLost, DynamixelBus, NoAnswer, Refused, tried
from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ServoDescription
from uam_sim_bridge.devices.dynamixel.control_table import WATCHDOG_TRIPPED, WATCHDOG_UNIT
from uam_sim_bridge.devices.dynamixel.health import ServoHealth, hardware_errors
from uam_sim_bridge.devices.dynamixel.parameters import HOLD, ArmDriverParameters

TORQUE, SUPPLY, WATCHDOG = "torque", "supply", "watchdog"
# one of them of one servo per slow read
SLOW_BLOCKS = {
    TORQUE: (names.TORQUE_ENABLE, names.HARDWARE_ERROR),
    SUPPLY: (names.PRESENT_VOLTAGE, names.PRESENT_TEMPERATURE),
    WATCHDOG: (names.BUS_WATCHDOG,),
}


class Upkeep:
    """Prepares, watches and ends the servos of a chain; fills their `health`."""

    def __init__(
        self,
        bus: DynamixelBus,
        chain: ArmChain,
        parameters: ArmDriverParameters,
        position_p_gain: float | None,
    ) -> None:
        """position_p_gain: of the servos' own loop in position mode; None: current mode."""
        self._bus, self._chain, self._p = bus, chain, parameters
        self._p_gain = position_p_gain
        self.health = [ServoHealth(servo.label, servo.joint) for servo in chain.servos]
        self.turns = [0] * len(chain.servos)  # [counts] see `ServoDescription.turned`
        self.forget()
        self._order = cycle(product(SLOW_BLOCKS, range(len(chain.servos))))

    def forget(self) -> None:
        """Regard every servo as unprepared, as after a lost device."""
        self.unprepared: set[int] = set(self._chain.ids)  # without torque
        self._next_slow = -math.inf

    def count(self, i: int, answered: bool) -> None:
        """Count an answered or missed read of servo i."""
        health = self.health[i]
        if answered:
            health.in_a_row, health.lost = 0, False
            return
        health.misses += 1
        health.in_a_row += 1
        if health.in_a_row >= self._p.missed_reads and not health.lost:
            health.lost = True
            self.unprepared.add(self._chain.ids[i])

    def prepare(self, i: int, counts: int) -> None:
        """Set goals to rest, torque and watchdog on; counts: present position of servo i.

        If it fails, the servo stays unprepared. Raises BusLost.
        """
        if self.health[i].error:
            return
        servo = self._chain.servos[i]
        self.turns[i] = servo.turned(counts)
        steps = [(names.BUS_WATCHDOG, 0)]
        if servo.mode is not None:  # its goal is then the present position
            profile = round(servo.speed / servo.table.velocity_unit)
            steps += [(names.PROFILE_VELOCITY, profile), (names.TORQUE_ENABLE, 1)]
            steps += [(names.GOAL_CURRENT, servo.current_limit_counts)]
        elif self._p_gain is None:
            steps += [(names.GOAL_CURRENT, 0), (names.TORQUE_ENABLE, 1)]
        else:
            steps += [(names.POSITION_P_GAIN, round(self._p_gain)), (names.TORQUE_ENABLE, 1)]
        try:
            for name, value in [
                *steps,
                (names.BUS_WATCHDOG, round(self._p.watchdog / WATCHDOG_UNIT)),
            ]:
                tried(self._bus.write, servo.id, servo.table[name], value)
        except NoAnswer:
            return
        except Refused:
            self._read_block(TORQUE, i)  # of an error that came meanwhile
            return
        self.health[i].torque_on = True
        self.unprepared.discard(servo.id)

    def read_slowly(self, now: float) -> None:
        """Read one slow block of one servo; that of a servo with an alert at once."""
        for i, servo in enumerate(self._chain.servos):
            if servo.id in self._bus.alerts and not self.health[i].error:
                self._read_block(TORQUE, i)
        if now < self._next_slow:
            return
        self._next_slow = now + self._p.slow_interval
        block, i = next(self._order)
        if not self.health[i].lost:
            self._read_block(block, i)

    def check_watchdogs(self) -> None:
        """Find the servos whose watchdog has tripped, after a silence of this driver."""
        for i in range(len(self._chain.servos)):
            self._read_block(WATCHDOG, i)

    def reboot(self) -> list[str]:
        """Restart the servos with a hardware error; return one line each."""
        done = []
        for servo, health in zip(self._chain.servos, self.health, strict=True):
            if not health.error:
                continue
            errors = ", ".join(hardware_errors(health.error))
            try:
                self._bus.reboot(servo.id)
            except (NoAnswer, Refused, BusLost) as error:
                done.append(f"{health.label}: {errors}; not rebooted: {error}")
                continue
            health.error = 0
            self.unprepared.add(servo.id)
            done.append(f"{health.label}: rebooted after {errors}")
        return done

    def end(self, servo: ServoDescription) -> None:
        """Torque off, or hold the present angle. Raises NoAnswer, Refused, BusLost."""
        keep, position_mode = self._p.ends_with == HOLD, self._p_gain is not None
        steps = [(names.BUS_WATCHDOG, 0)]
        if not (keep and position_mode):
            steps.append((names.TORQUE_ENABLE, 0))
        if keep and not position_mode:
            steps += [
                (names.OPERATING_MODE, names.CURRENT_POSITION_MODE),
                (names.TORQUE_ENABLE, 1),  # its goal is then the present position
            ]
        for name, value in steps:
            tried(self._bus.write, servo.id, servo.table[name], value)

    def _read_block(self, block: str, i: int) -> None:
        servo, health = self._chain.servos[i], self.health[i]
        span = servo.table.span(*SLOW_BLOCKS[block])
        try:
            data = self._bus.read_bytes(servo.id, span)
        except (NoAnswer, Refused):
            return
        values = {
            name: int.from_bytes(servo.table[name].of(data, span.address), "little")
            for name in SLOW_BLOCKS[block]
        }
        if block == SUPPLY:
            health.temperature = float(values[names.PRESENT_TEMPERATURE])
            health.voltage = values[names.PRESENT_VOLTAGE] * names.VOLTAGE_UNIT
        elif block == WATCHDOG:
            if values[names.BUS_WATCHDOG] == WATCHDOG_TRIPPED and servo.id not in self.unprepared:
                health.trips += 1
                self.unprepared.add(servo.id)
        else:
            health.error = values[names.HARDWARE_ERROR]
            health.torque_on = bool(values[names.TORQUE_ENABLE])
            if not health.torque_on and servo.id not in self.unprepared:
                health.restarts += not health.error
                self.unprepared.add(servo.id)
