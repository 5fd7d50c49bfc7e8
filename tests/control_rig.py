"""A control tick on a vehicle that stands still, with an autopilot that does what it is told."""

import numpy as np

from uam_control.mission import load_scenario
from uam_control.offboard.exchange import Reported, Request
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence
from uam_control.profiles.profile import default_profile
from uam_control.stages.bridge_stage import BridgeSets, BridgeStage
from uam_control.stages.control_tick import ControlTick
from uam_control.stages.tick_stamps import Timing
from uam_control.vehicle import load_description

PERIOD = 4_000_000  # [ns]
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
REST, WEIGHT = np.zeros(3), np.array([0.0, 0.0, 9.81])
LOW = np.array([0.0, 0.0, 0.2])


class Port:
    """An autopilot that applies each command at once and stores the setpoints."""

    def __init__(self, sequence):
        self.sequence = sequence
        self.armed, self.mode, self.landed, self.armed_since = False, Mode.HOLD, True, None
        self.killed, self.loss_time = False, 1.0
        self.round_trip = 0.01
        self.poses, self.setpoints = [], []

    def connected(self, time):
        return True

    def silent(self, time):
        return False

    def poll(self, time):
        pass

    def tick(self, time):
        request = self.sequence.update(time, Reported(True, self.armed, self.mode))
        if request is Request.OFFBOARD:
            self.mode = Mode.OFFBOARD
        elif request is not None:
            self.armed = request is Request.ARM
            self.armed_since = time if self.armed else None

    def send_vision(self, pose):
        self.poses.append(pose.stamp)

    def send_setpoint(self, setpoint, time):
        self.setpoints.append((time, setpoint))


class Rig:
    """A control tick on a vehicle that stands still."""

    def __init__(self, law="modular", **section):
        """section: parameters of the bridge."""
        vehicle = load_description()
        sequence = OffboardSequence()
        self.port = Port(sequence)
        bridge = BridgeStage(BridgeSets.of(vehicle, section), vehicle, self.port, sequence)
        sets = default_profile(law).sets
        self.control = ControlTick.of(load_scenario("hover"), sets, bridge, Timing())
        self.signals = self.control.signals
        self.stamp = 0
        start = self.control.mission.mission.scenario.arm_start
        self.angles = np.array(start)

    def tick(self, mocap=True, joints=True, imu=True, noise=1e-6):
        """One tick; every pose differs a little, as a tracker's do."""
        stamp, moved = self.stamp, LOW + noise * self.stamp / PERIOD
        zero = np.zeros(len(self.angles))
        self.stamp += PERIOD
        return self.control.tick(
            (stamp, moved, LEVEL) if mocap else None,
            (stamp, self.angles, zero, zero) if joints else None,
            (stamp, REST, WEIGHT) if imu else None,
        )

    def run(self, seconds, **samples):
        for _ in range(round(seconds / 0.004)):
            self.tick(**samples)
