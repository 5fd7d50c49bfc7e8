"""Parameters of the arm's driver."""

from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, choice, integer, number, switch

TORQUE_OFF, HOLD = "torque_off", "hold"


@dataclass(frozen=True)
class ArmDriverParameters(ParameterSet):
    """How the driver runs the bus; the chain itself is described in the hardware file."""

    rate: float = number(0.0, "cycles per second, 0: the control rate", "Hz", 0.0, 1000.0)
    fast_sync_read: bool = switch(
        True, "read all servos in one packet (Fast Sync Read, firmware 45 or newer)"
    )
    answer_timeout: float = number(
        0.004, "longest wait for an answer beside its bytes and the latency timer", "s", 0.0005, 5.0
    )
    effort_timeout: float = number(
        0.1, "age of the last effort command from which the torque is zero", "s", 0.01, 5.0
    )
    watchdog: float = number(
        0.1, "silence of the bus after which a servo stops by itself, 0: off", "s", 0.0, 2.54
    )
    missed_reads: int = integer(
        5, "reads in a row without an answer after which a servo is lost", 1, 1000
    )
    slow_interval: float = number(
        0.04,
        "time between two slow reads (temperature, voltage, errors), of one servo each",
        "s",
        0.004,
        5.0,
    )
    reopen_interval: float = number(
        0.5, "time between two attempts to open a lost device", "s", 0.01, 60.0
    )
    write_settings: bool = switch(
        True,
        "write operating mode, return delay and current limit to servos that have others; false: "
        "refuse to start",
    )
    friction_compensation: bool = switch(
        False, "add the identified friction at the desired velocity to the effort"
    )
    friction_speed: float = number(
        0.1, "velocity at which the compensated Coulomb friction has 76 %", "rad/s", 0.001, 10.0
    )
    pose_tolerance: float = number(
        0.3, "distance from the stowed angles at the start that is reported", "rad", 0.01, 6.3
    )
    ends_with: str = choice(
        TORQUE_OFF,
        "at the end of the driver: torque_off, the arm hangs; hold, the servos keep their angles",
        (TORQUE_OFF, HOLD),
        fixed=True,
    )
