"""A hover flown by whichever autopilot connects: the plant, the laws and the MAVLink link of every
flight in one loop, without ROS.

The laws see the true state, so that nothing but the autopilot differs between two of these.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.coordinates import ARM, ATTITUDE, CHI, POSITION
from uam_control.frames import swap_body
from uam_control.laws.catalogue import DEFAULT
from uam_control.mission.motion.trajectory import empty_reference
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.profiles.profile import load_profile
from uam_control.setpoints.rate_thrust_map import RateThrustMap
from uam_control.setpoints.targets import AttitudeTarget, VisionPose
from uam_control.vehicle import load_description
from uam_sim_bridge.mavlink.hil.hil_server import WAITS, HilServer
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.transport.transport import UdpTransport
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.ports import Ports

HOST = "127.0.0.1"
SEED = 1
VISION_TICKS = 5  # a pose every 20 ms
POSITION_DEVIATION, ATTITUDE_DEVIATION = 0.005, 0.02  # [m], [rad], as the bridge sends
LONGEST_WAIT = 90.0  # [s] simulated, for an autopilot that boots
NEAR_GROUND = 0.05  # [m] above where it stood


class NotFlown(RuntimeError):
    """The autopilot did not fly; the text is one line."""


class HoverFlight:
    """One flight, tick by tick.

    `modes_seen`: those of the autopilot since `take_off`; `largest_tilt` [rad] and
    `hardest_touchdown` [m/s], the speed downwards just above the ground, likewise.
    """

    def __init__(self, ports: Ports, always_answers: bool) -> None:
        """always_answers: the stand-in does; PX4 is silent while it boots."""
        vehicle = load_description()
        profile = load_profile(vehicle.profile(DEFAULT))
        self.plant = MujocoPlant(Vehicle.of(vehicle), 0.0, SEED)
        self._position = PositionController(profile.sets["position_controller"])
        self._attitude = AttitudeController(profile.sets["attitude_controller"])
        self._arm = ArmController(profile.sets["arm_controller"])
        self._map = RateThrustMap()
        self._sequence = OffboardSequence()
        waits = WAITS
        if always_answers:
            waits = WAITS[0], WAITS[0]
        self._hil = HilServer(ports.simulator_tcp, len(vehicle.rotors), waits=waits)
        self._transport = UdpTransport(ports.offboard_udp, (HOST, ports.autopilot_udp))
        self.system = ports.instance + 1  # MAVLink system id of the autopilot
        self._link = OffboardLink(
            self._transport, self._sequence, self._map.parameters, self.system
        )
        self._reference = empty_reference(len(vehicle.joints))
        self._reference[CHI, ARM] = vehicle.stowed
        self._state = np.zeros_like(self._reference)
        self._setpoint = np.zeros(4)
        self._flying = False
        self._standing = 0.0  # height [m] before take-off
        self.modes_seen: set[Mode] = set()
        self.largest_tilt = self.hardest_touchdown = 0.0

    @property
    def mode(self) -> Mode:
        """Last received state of the autopilot."""
        return self._link.mode

    @property
    def armed(self) -> bool:
        """Whether the motors may turn, as the simulator sees it."""
        return self._hil.armed

    @property
    def phase(self) -> Phase:
        """Where our side of the link stands."""
        return self._sequence.phase

    @property
    def height(self) -> float:
        """True height [m] of the body's origin."""
        return float(self._state[0, 2])

    @property
    def on_ground(self) -> bool:
        """Whether it is about where it stood before take-off."""
        return self.height < self._standing + NEAR_GROUND

    def connect(self, patience: float) -> None:
        """Wait for the autopilot to connect, `patience` seconds at most. Raises NotFlown."""
        if not self._hil.accept(patience):
            raise NotFlown(f"no autopilot connected within {patience:g} s")

    def take_off(self, height: float = 1.5, speed: float = 0.5, settle: float = 3.0) -> None:
        """Arm, climb to `height` [m] at `speed` [m/s], hover for `settle` [s]. Raises NotFlown."""
        self._sequence.set_desired(True)
        while self._sequence.phase is not Phase.FLYING:
            self.tick()
            if self.plant.time > LONGEST_WAIT or self._sequence.phase is Phase.FAILED:
                raise NotFlown("; ".join(self._sequence.reasons) or "the autopilot did not arm")
        self._flying = True
        self._standing = self.height
        reference = self._reference
        for _ in range(self._ticks(height / speed)):
            reference[0, 2] = min(height, reference[0, 2] + speed * self.plant.period)
            reference[1, 2] = speed
            self.tick()
        reference[1, 2] = 0.0
        self.hover(settle)
        self.modes_seen, self.largest_tilt, self.hardest_touchdown = {self.mode}, 0.0, 0.0

    def hover(self, duration: float) -> None:
        """Fly on for `duration` [s]."""
        for _ in range(self._ticks(duration)):
            self.tick()

    def mute(self, duration: float) -> None:
        """Send nothing to the autopilot for `duration` [s]: no setpoint, heartbeat or vision."""
        for _ in range(self._ticks(duration)):
            self.tick(link=False)

    def blind(self, duration: float) -> None:
        """Send no vision for `duration` [s]."""
        for _ in range(self._ticks(duration)):
            self.tick(vision=False)

    def send_raw(self, data: bytes) -> None:
        """Send bytes over the link, whatever they are."""
        self._transport.send(data)

    def tick(
        self, replaced: tuple[int, float] | None = None, link: bool = True, vision: bool = True
    ) -> np.ndarray:
        """One control period; returns the true body rates (3,) [rad/s, FLU] at its beginning.

        replaced: an axis 0..2 and what its body-rate setpoint [rad/s] is instead. Raises NotFlown
        when the autopilot hangs up.
        """
        plant, state, dt = self.plant, self._state, self.plant.period
        samples = plant.sense()
        now = plant.time
        truth = plant.truth()
        state[:] = truth.state
        rates = state[1, ATTITUDE].copy()
        quaternion = truth.quaternion
        self._link.poll(now)
        tau_p = self._position.update(state, self._reference, self._flying, dt)
        desired = self._position.attitude_reference
        tau_q = self._attitude.update(state, self._reference, desired, self._flying, dt)
        effort = self._arm.update(state, self._reference, desired, self._flying, dt)
        setpoint = self._setpoint
        setpoint[:] = 0.0
        if self._flying:
            desired, setpoint[3] = self._map.map(tau_p, tau_q, state[0, ATTITUDE], rates)
            setpoint[:3] = desired
        if replaced is not None:
            setpoint[replaced[0]] = replaced[1]
        if link:
            self._send(now, quaternion, vision)
        self._hil.send(now, samples.hil[1], samples.hil[2], state[0, POSITION], quaternion)
        motors = self._hil.receive()
        if not self._hil.connected:
            raise NotFlown(f"the autopilot hung up at t = {now:.3f} s")
        plant.step(motors, effort, False)
        self._note()
        return rates

    def close(self) -> None:
        """Hang up."""
        self._link.close()
        self._hil.close()

    def _send(self, now: float, quaternion: np.ndarray, vision: bool) -> None:
        link = self._link
        link.tick(now)
        if vision and self.plant.tick % VISION_TICKS == 0:
            link.send_vision(
                VisionPose(
                    now,
                    self._state[0, POSITION],
                    quaternion,
                    POSITION_DEVIATION,
                    ATTITUDE_DEVIATION,
                )
            )
        if self._sequence.streaming:
            rates, thrust = swap_body(self._setpoint[:3]), float(self._setpoint[3])
            link.send_setpoint(AttitudeTarget.of_rates(rates, thrust), now)

    def _note(self) -> None:
        roll, pitch = self._state[0, 3:5]
        self.modes_seen.add(self.mode)
        self.largest_tilt = max(self.largest_tilt, math.acos(math.cos(roll) * math.cos(pitch)))
        if self.on_ground:
            self.hardest_touchdown = max(self.hardest_touchdown, -float(self._state[1, 2]))

    def _ticks(self, duration: float) -> int:
        return round(duration / self.plant.period)
