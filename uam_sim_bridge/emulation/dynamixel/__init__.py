"""An emulated chain of Dynamixel X-series servos behind a pseudo-terminal, Protocol 2.0."""

from uam_sim_bridge.emulation.dynamixel.arm_shafts import ArmShafts
from uam_sim_bridge.emulation.dynamixel.bus import EmulatedBus
from uam_sim_bridge.emulation.dynamixel.line import BusFaults, ServoLine
from uam_sim_bridge.emulation.dynamixel.servo import EmulatedServo
from uam_sim_bridge.emulation.dynamixel.shafts import Drive, FrictionShaft, Shaft, StillShaft
