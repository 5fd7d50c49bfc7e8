"""An arm for the tests: emulated servos, a driver without device and threads, a clock by hand."""

import dataclasses
import math

from servo_shafts import StillShaft
from set_clock import SetClock

from uam_control.vehicle import load_description
from uam_sim_bridge.devices.dynamixel.bus import DynamixelBus
from uam_sim_bridge.devices.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedServo, ServoLine
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.devices.serial.serial_port import SerialPort

BAUD = 1_000_000
STOWED = (0.0, math.pi / 2)
PATIENT = 30.0  # [s] for an answer on a pseudo-terminal: on a busy machine it may take long


class LinePort(SerialPort):
    """The driver's port joined to the servos: an answer is there at once, or never."""

    def __init__(self, line):
        super().__init__("line", allowance=0.0)
        self.line, self.plugged, self.received = line, True, b""
        self.written = []  # packets

    def open(self, baud_rate):
        self._check()
        self.baud_rate = baud_rate

    def close(self):
        pass

    def send(self, data):
        self._check()
        self.written.append(data)
        self.received = b"".join(answer for _, answer in self.line.receive(data, self.baud_rate))

    def read(self):
        self._check()
        data, self.received = self.received, b""
        return data

    def _check(self):
        if not self.plugged:
            raise OSError(5, "Input/output error")


class ArmRig:
    """A stowed arm of two joints and its driver; `start()` ends with torque on."""

    def __init__(
        self, shafts=None, servos=None, chain=None, mode="current", seed=1, clock=None, **parameters
    ):
        """shafts, servos: in place of still ones; chain: changes of every servo's description."""
        self.clock = clock or SetClock(100.0)
        self.vehicle = load_description()
        self.chain = described(**(chain or {}))
        self.shafts = shafts or [StillShaft(angle) for angle in STOWED]
        self.servos = servos or [
            EmulatedServo(i + 1, shaft, baud_rate=BAUD, clock=self.clock)
            for i, shaft in enumerate(self.shafts)
        ]
        self.line = ServoLine(self.servos, seed)
        self.port = LinePort(self.line)
        self.parameters = ArmDriverParameters.from_mapping(parameters)
        self.driver = ArmDriver(self.chain, self.parameters, mode, clock=self.clock, port=self.port)

    def start(self):
        """Start the driver and let it switch the torque on."""
        self.driver.start()
        self.cycle()
        return self

    def cycle(self, count=1, effort=None, step=0.004, velocity=None):
        """Run cycles, each with a fresh command if there is an effort; return the last reading."""
        reading = None
        for _ in range(count):
            if effort is not None:
                self.driver.command_effort(effort, velocity)
            reading = self.driver.cycle()
            self.clock.now += step
            self.line.tick()
        return reading

    @property
    def currents(self):
        """Goal currents [A] of the servos with torque, else None."""
        return [shaft.last.current if shaft.last.on else None for shaft in self.shafts]


def described(device="line", **changes):
    """The chain of config/lab/s500_lab.yaml, every servo with `changes`."""
    chain = load_chain(hardware_file("s500_lab"), load_description())
    servos = tuple(dataclasses.replace(servo, **changes) for servo in chain.servos)
    return dataclasses.replace(chain, device=device, servos=servos)


def raw_bus(line):
    """A bus without driver on the line."""
    bus = DynamixelBus("line", BAUD, 0.0, LinePort(line))
    bus.open()
    return bus
