"""An emulated chain of Dynamixel X-series servos behind a pseudo-terminal, Protocol 2.0."""

from uam_sim_bridge.devices.dynamixel.emulated.line import EmulatedBus, ServoLine
from uam_sim_bridge.devices.dynamixel.emulated.servo import EmulatedServo
from uam_sim_bridge.devices.dynamixel.emulated.shafts import ArmShafts, Drive, JointShaft, Shaft
