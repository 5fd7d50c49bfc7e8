"""Conversion of a battery state to sensor_msgs/BatteryState."""

import math
from typing import Protocol

from sensor_msgs.msg import BatteryState

from uam_msgs_py.messages.stamps import set_stamp

_NAN = math.nan


class BatteryReading(Protocol):
    """A battery state: voltage [V], current [A] (positive: discharge), left 0..1, temperature
    [deg C], cells [V]; NaN means unknown.
    """

    voltage: float
    current: float
    left: float
    temperature: float
    cells: tuple[float, ...]


def battery_message(stamp: int, battery: BatteryReading) -> BatteryState:
    """Return the message; stamp [ns]. `present` is False for an unknown voltage."""
    message = BatteryState(
        voltage=battery.voltage,
        temperature=battery.temperature,
        current=-battery.current,  # ROS: negative when discharging
        charge=_NAN,
        capacity=_NAN,
        design_capacity=_NAN,
        percentage=battery.left,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_UNKNOWN,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        present=math.isfinite(battery.voltage),
        cell_voltage=list(battery.cells),
    )
    set_stamp(message.header.stamp, stamp)
    return message
