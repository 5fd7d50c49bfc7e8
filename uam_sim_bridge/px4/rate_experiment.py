"""Steps of the body-rate setpoint in hover, flown by whichever autopilot connects.

Plant, laws and MAVLink link are those of every flight, in one loop without ROS; the laws see the
true state, so that nothing but the autopilot differs. During a step the setpoint of one axis is
replaced by a constant; between steps the position controller brings the vehicle back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from uam_control import configuration
from uam_control.controllers import ArmController, AttitudeController, PositionController
from uam_control.coordinates import ATTITUDE, POSITION
from uam_control.mission.trajectory import empty_reference
from uam_control.profile import load_profile
from uam_sim_bridge.flight.ports import Ports
from uam_sim_bridge.mavlink.hil_server import HilParameters, HilServer
from uam_sim_bridge.mavlink.link import OffboardLink
from uam_sim_bridge.mavlink.offboard import OffboardSequence, Phase
from uam_sim_bridge.mavlink.setpoint import RateThrustMap
from uam_sim_bridge.mavlink.udp_transport import UdpTransport
from uam_sim_bridge.plant import Plant, Vehicle

HOST = "127.0.0.1"
AXES = ("roll", "pitch", "yaw")
PAYLOAD_SEED = 1
VISION_TICKS = 5  # a pose every 20 ms
POSITION_DEVIATION, ATTITUDE_DEVIATION = 0.005, 0.02  # [m], [rad], as the bridge tells
LONGEST_WAIT = 90.0  # [s] simulated, for an autopilot that boots
ARM = np.array([0.0, np.pi / 2.0])  # hanging folded, as on the ground


class NotFlown(RuntimeError):
    """The autopilot did not fly; the text is one line."""


@dataclass(frozen=True)
class Step:
    """One step: of the rate about `axis` (0..2), `size` [rad/s] with its sign, `duration` [s]."""

    axis: int
    size: float
    duration: float


def experiment() -> dict[str, Any]:
    """config/px4/rate_steps.yaml."""
    return yaml.safe_load(configuration.path("px4/rate_steps.yaml").read_text())


def steps(numbers: Mapping[str, Any]) -> Iterator[Step]:
    """Every step of the experiment, in order."""
    for axis, name in enumerate(AXES):
        size, duration = numbers["steps"][name]
        for _ in range(numbers["repeats"]):
            yield Step(axis, size, duration)
            yield Step(axis, -size, duration)


class RateExperiment:
    """The experiment against the autopilot that connects to the ports of an instance."""

    def __init__(self, ports: Ports, always_answers: bool, numbers: Mapping[str, Any]) -> None:
        """always_answers: the stand-in does; PX4 is silent while it boots."""
        profile = load_profile("s500")
        self._numbers = numbers
        self._plant = Plant(Vehicle.load(), 0.0, PAYLOAD_SEED, tuple(ARM))
        self._position = PositionController(profile.sets["position_controller"])
        self._attitude = AttitudeController(profile.sets["attitude_controller"])
        self._arm = ArmController(profile.sets["arm_controller"])
        self._map = RateThrustMap()
        self._sequence = OffboardSequence()
        waits = HilParameters()
        if always_answers:
            waits = HilParameters(silent_timeout=waits.answer_timeout)
        self._hil = HilServer(ports.simulator_tcp, parameters=waits)
        transport = UdpTransport(ports.offboard_udp, (HOST, ports.autopilot_udp))
        self._link = OffboardLink(
            transport, self._sequence, self._map.parameters, ports.instance + 1)
        self._reference = empty_reference()
        self._reference[0, 6:8] = ARM
        self._state = np.zeros((3, 8))
        self._setpoint = np.zeros(4)

    def connect(self, patience: float) -> None:
        """Wait for the autopilot to connect, `patience` seconds at most. Raises NotFlown."""
        if not self._hil.accept(patience):
            raise NotFlown(f"no autopilot connected within {patience:g} s")

    def run(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Fly; returns, per axis, time (n,) [s] from the step and the mean response (n,) to 1.

        Raises NotFlown.
        """
        numbers, period = self._numbers, self._plant.period
        self._sequence.want(True)
        while self._sequence.phase is not Phase.FLYING:
            self._tick(flying=False)
            if self._plant.time > LONGEST_WAIT or self._sequence.phase is Phase.FAILED:
                raise NotFlown("; ".join(self._sequence.reasons) or "the autopilot did not arm")
        climb = numbers["hover_height"] / numbers["climb_speed"]
        for _ in range(round((climb + numbers["settle"]) / period)):
            self._climb()
            self._tick(flying=True)
        before = round(numbers["before"] / period)
        found: dict[str, list[np.ndarray]] = {name: [] for name in AXES}
        for step in steps(numbers):
            for _ in range(round(numbers["recover"] / period) - before):
                self._tick(flying=True)
            rates = [self._tick(flying=True)[step.axis] for _ in range(before)]
            rates += [self._tick(flying=True, step=step)[step.axis]
                      for _ in range(round(step.duration / period))]
            found[AXES[step.axis]].append(np.array(rates) / step.size)
        return {
            name: ((np.arange(len(curves[0])) - before) * period, np.mean(curves, axis=0))
            for name, curves in found.items()
        }

    def close(self) -> None:
        """Hang up."""
        self._link.close()
        self._hil.close()

    def _climb(self) -> None:
        reference, numbers = self._reference, self._numbers
        reference[0, 2] += numbers["climb_speed"] * self._plant.period
        reference[1, 2] = numbers["climb_speed"]
        if reference[0, 2] >= numbers["hover_height"]:
            reference[0, 2], reference[1, 2] = numbers["hover_height"], 0.0

    def _tick(self, flying: bool, step: Step | None = None) -> np.ndarray:
        """One control period; returns the body rates (3,) [rad/s, FLU] at its beginning."""
        plant, state, link, dt = self._plant, self._state, self._link, self._plant.period
        samples = plant.sense()
        now = plant.time
        plant.write_truth_state(state)
        rates = state[1, ATTITUDE].copy()
        quaternion = plant.truth().quaternion
        link.poll(now)
        link.tick(now)
        if plant.tick % VISION_TICKS == 0:
            link.send_vision(now, state[0, POSITION], quaternion,
                             POSITION_DEVIATION, ATTITUDE_DEVIATION)
        tau_p = self._position.update(state, self._reference, flying, dt)
        asked = self._position.attitude_reference
        tau_q = self._attitude.update(state, self._reference, asked, flying, dt)
        effort = self._arm.update(state, self._reference, asked, flying, dt)
        setpoint = self._setpoint
        setpoint[:] = 0.0
        if flying:
            wanted, setpoint[3] = self._map.map(tau_p, tau_q, state[0, ATTITUDE], rates)
            setpoint[:3] = wanted
        if step is not None:
            setpoint[step.axis] = step.size
        if self._sequence.streaming:
            link.send_setpoint(setpoint[:3], setpoint[3], now)
        motors = self._hil.exchange(
            now, samples.hil[1], samples.hil[2], state[0, POSITION], quaternion)
        if not self._hil.connected:
            raise NotFlown(f"the autopilot hung up at t = {now:.3f} s")
        if flying and not self._link.armed:
            raise NotFlown("; ".join(self._sequence.reasons) or "the autopilot disarmed")
        plant.step(motors, effort, False)
        return rates
