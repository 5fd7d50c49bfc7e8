"""The laboratory: a plant behind emulated devices, tick by tick. No ROS.

    motors ◀─ HIL over TCP or a line ─▶ autopilot ◀─ serial cable ─▶ bridge
    joints ◀─▶ emulated Dynamixel bus ◀─ pseudo-terminal ─▶ arm_driver
    poses ──▶ emulated NatNet server ──▶ mocap_driver
    magnet ◀── simulated GPIO line ◀── magnet_driver

The plant's own delays of sensors and commands are off where a device has its own.
"""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DOT, POSITION
from uam_control.vehicle import POSITION_SERVO, VehicleDescription
from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ServoDescription
from uam_sim_bridge.devices.dynamixel.emulated import (
    ArmShafts,
    EmulatedBus,
    EmulatedServo,
    JointShaft,
)
from uam_sim_bridge.devices.dynamixel.startup import required_mode
from uam_sim_bridge.devices.mocap.calibration import Calibration
from uam_sim_bridge.devices.mocap.emulated.mocap_server import MocapServer, Streaming
from uam_sim_bridge.devices.serial.serial_cable import SerialCable
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.laboratory.hil_line import HilLine
from uam_sim_bridge.laboratory.laboratory_parameters import LINE, TOPIC, LaboratoryParameters
from uam_sim_bridge.laboratory.person import Grip, joint_torque, wrench
from uam_sim_bridge.laboratory.set_up import RoomBody, mistaken_chain, mistaken_room
from uam_sim_bridge.mavlink.hil.hil_server import HilServer
from uam_sim_bridge.plant import Samples, Truth, Vehicle, warm_up
from uam_sim_bridge.plant.plant import DEFAULT_PLANT, plant_class

ADAPTER_LATENCY = 0.001  # [s] latency timer of the servo bus's adapter
OWN_DELAYS = {  # those that the emulated devices have
    "sensors.joints.latency_ticks": 0,
    "servos.command_latency_ticks": 0,
}
CONTROLS_OF_ACTUATORS = 6  # the last ones of HIL_ACTUATOR_CONTROLS
# in the folder; USB: sensors and motors of an autopilot in HITL
BUS_DEVICE, SERIAL_NEAR, SERIAL_FAR, USB = "ttyARM", "ttyTELEM2", "ttyAUTOPILOT", "ttyUSB"


class Laboratory:
    """Plant and devices; `step` advances one control period.

    `folded` (n,): the arm at the start [rad], as which hands hold it until the servos are first
    driven. `imu_plugged`: whether the companion's own IMU is there; `poses_come`: whether another's
    driver of the motion capture has poses.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        parameters: LaboratoryParameters,
        chain: ArmChain,
        calibration: Calibration,
        wiring: Schedule | None = None,
    ) -> None:
        """chain: servos as described; calibration: of the cameras; wiring: faults of cables, and
        mistakes of the set-up.

        Raises OSError (port in use), FaultError.
        """
        latency = vehicle.numbers["sensors"]["mocap"]["latency_ticks"]
        own = {} if parameters.poses == TOPIC else {"sensors.mocap.latency_ticks": 0}
        vehicle = vehicle.changed(OWN_DELAYS | own)
        self.description: VehicleDescription = vehicle.description
        p, self.chain, self.calibration = parameters, chain, calibration
        start = tuple(p.arm_start)
        plant = partial(plant_class(DEFAULT_PLANT), vehicle, p.payload_mass, p.seed, start)
        self.plant = plant()
        warm_up(plant())
        self.parameters = p
        self.wiring = wiring or Schedule()
        self.timeline = Timeline(self.wiring)  # of the faults after the start, see `pull_cables`
        self.grip = Grip()  # the person's hands
        self.folded = np.array(start or vehicle.description.stowed, dtype=float)
        self._driven = False  # whether the servos have had a command
        self._weight = vehicle.numbers["mass"] * vehicle.numbers["gravity"]
        self._in_position_mode = vehicle.numbers["servos"]["mode"] == POSITION_SERVO
        mounted = mistaken_chain(chain, self.wiring)
        joints = len(chain.arm)
        self.shafts, self._fingers = ArmShafts(mounted[:joints]), ArmShafts(mounted[joints:])
        self._hand = np.zeros(joints)  # (n,) [N m] of the person on the joints
        self._turn_shafts(self.plant.truth())
        mode = required_mode(vehicle.numbers["servos"]["mode"])
        shafts = [*self.shafts.shafts, *self._fingers.shafts]
        self.servos = servos_of(chain, mounted, shafts, mode)
        self.bus = EmulatedBus(
            self.servos,
            timing=True,
            latency_timer=ADAPTER_LATENCY,
            seed=p.seed,
            link=p.places / BUS_DEVICE,
        )
        self.cable = SerialCable(p.places / SERIAL_NEAR, p.places / SERIAL_FAR, p.baud, p.seed)
        self.mocap = MocapServer(
            mistaken_room(self._bodies(), self.wiring),
            # the plant's own rate decides
            Streaming(
                rate=1.0 / self.plant.period,
                port=p.mocap_port,
                latency=max(0.0005, latency * self.plant.period),
            ),
        )
        rotors = len(self.description.rotors)
        if p.hil == LINE:
            self.hil: HilServer | HilLine = HilLine(p.places / USB, rotors, p.seed)
        else:
            self.hil = HilServer(p.hil_port, rotors, seed=p.seed)
        self.hil_plugged = self.magnet_plugged = self.imu_plugged = self.poses_come = True
        self.magnet = False
        self.mocap.start()

    def _bodies(self) -> list[RoomBody]:
        """Return the bodies in the order of the server's list: vehicle, payload."""
        p, calibration = self.parameters, self.calibration
        found = [RoomBody(p.body, calibration)]
        if p.payload:
            found.append(RoomBody(p.payload, calibration.without_body()))
        return found

    def pull_cables(self, stamp: float) -> list[FaultState]:
        """Pull the cables that are due at `stamp` [s], the plant's time, and plug them in again.

        Returns the faults that began or ended.
        """
        changed = self.timeline.update(stamp)
        for one in changed:
            one.fault.pull(self, one.active)
        for fault in self.timeline.active:
            fault.last(self)
        return changed

    def sense(self, host: float) -> tuple[Samples, Truth]:
        """Sample the sensors of this tick; expose the cameras at `host` [s], system's time."""
        samples, truth = self.plant.sense(), self.plant.truth()
        self._turn_shafts(truth)
        if samples.mocap is not None:
            p, exposed = self.parameters, host + samples.mocap[0] - self.plant.time
            poses = {p.body: samples.mocap[1:]}
            if p.payload and samples.payload is not None:
                poses[p.payload] = samples.payload[1:]
            self.mocap.expose(exposed, poses)
        return samples, truth

    def send_hil(self, samples: Samples, truth: Truth) -> None:
        """Send the autopilot its sensors, unless its link is pulled."""
        if self.hil_plugged:
            now, gyro, force = samples.hil
            self.hil.send(now, gyro, force, truth.state[CHI, POSITION], truth.quaternion)

    def receive_hil(self) -> np.ndarray:
        """Return the motor commands (rotors,) 0..1; zeros while the link is pulled."""
        motors = self.hil.receive(0.0)
        return motors if self.hil_plugged else np.zeros_like(motors)

    def step(self, motors: np.ndarray, truth: Truth) -> None:
        """Advance one control period with the commands of the devices."""
        self.magnet = self._switched()
        self._turn_fingers(truth)
        command = self.shafts.command(self._in_position_mode)
        self._driven = self._driven or bool(np.any(np.nan_to_num(command)))
        joints = self.grip.joints
        if joints is None and not self._driven:
            joints = self.folded
        self._hand = joint_torque(Grip(joints=joints), truth.state)
        if self._in_position_mode:
            if joints is not None:
                command = np.where(np.isnan(command), joints, command)
        else:
            command = command + self._hand
        self.plant.push(*wrench(self.grip, truth.state, self._weight))
        # the gripper's servo has a goal of its own
        self.plant.step(motors, command, self.magnet and not self._fingers.shafts)

    def _turn_fingers(self, truth: Truth) -> None:
        """Give the gripper's servo its state, and the fingers the goal of the servo."""
        if not self._fingers.shafts:
            return
        lever, (closed, opened) = self.chain.transmission, self.description.gripper.opening
        opening, force = truth.grip
        self._fingers.set(*(np.array([one]) for one in (opening / lever, 0.0, -force * lever)))
        goal = self._fingers.command(True).item() * lever
        if math.isfinite(goal):  # without torque the gear keeps them where they are
            self.plant.open_to(goal)
            self.magnet = goal < 0.5 * (closed + opened)

    def _turn_shafts(self, truth: Truth) -> None:
        """Give the servos angles, velocities and torques of this tick."""
        torque = self.plant.servos.torque - self._hand
        self.shafts.set(truth.state[CHI, ALPHA:], truth.state[CHI_DOT, ALPHA:], torque)

    def _switched(self) -> bool:
        """Return whether current flows through the magnet."""
        if not self.magnet_plugged:
            return False
        p, line = self.parameters, self.parameters.gpio
        if line is None:
            first = len(self.hil.controls) - CONTROLS_OF_ACTUATORS
            value = self.hil.controls[first + p.magnet_output - 1]
            return bool(abs(value - p.magnet_on) < abs(value - p.magnet_off))
        try:
            level = line.read_text(encoding="utf-8") == "1"
        except OSError:
            return False
        inverted = any(one.fault.NAME == "magnet_inverted" for one in self.wiring.faults)
        return (level is not p.active_low) is not inverted

    def close(self) -> None:
        self.hil.close()
        self.mocap.stop()
        self.cable.close()
        self.bus.close()


def servos_of(
    chain: ArmChain, mounted: Sequence[ServoDescription], shafts: Sequence[JointShaft], mode: int
) -> list[EmulatedServo]:
    """Return the servos in the order of the joints, set up as described; mode: Operating Mode."""
    made = []
    for servo, shaft in zip(mounted, shafts, strict=True):
        one = EmulatedServo(
            servo.id,
            shaft,
            servo.table.model,
            chain.baud_rate,
            current_unit=servo.current_unit,
        )
        one.set(names.RETURN_DELAY, chain.return_delay_counts)
        one.set(names.OPERATING_MODE, mode if servo.mode is None else servo.mode)
        one.set(names.CURRENT_LIMIT, servo.current_limit_counts)
        made.append(one)
    return made
