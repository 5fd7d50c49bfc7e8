"""MAVLink bridge and autopilot of the direct engine: the same objects, joined without a link."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from uam_control.estimation.repeats import Repeats
from uam_control.mission import MissionOutput
from uam_control.supervision import State
from uam_control.vehicle import VehicleDescription
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.offboard.hold import HoldParameters
from uam_sim_bridge.mavlink.offboard.sequence import (
    HEARTBEAT_TIMEOUT,
    OffboardParameters,
    OffboardSequence,
    Request,
)
from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustMap, RateThrustParameters
from uam_sim_bridge.mavlink.offboard.setpoint_source import SetpointSource, Situation
from uam_sim_bridge.mavlink.offboard.thrust_identification import (
    ThrustIdentification,
    ThrustIdentificationParameters,
)
from uam_sim_bridge.mavlink.protocol.frames import swap_body, swap_quaternion, swap_world
from uam_sim_bridge.mavlink.protocol.modes import CUSTOM_MODE_ENABLED, MavCmd, Mode


class DirectBridge:
    """What the MAVLink bridge and the autopilot do, joined without a link.

    `setpoint` (4,): body rates [rad/s, FLU] and normalised thrust of the last tick; `factor`: the
    thrust factor it was made with.
    """

    def __init__(self, section: Mapping[str, Any], vehicle: VehicleDescription) -> None:
        """section: what the profile says of the mavlink_bridge node; {} for its defaults."""
        self.map = RateThrustMap(RateThrustParameters.of(vehicle, section), vehicle)
        thrust = ThrustIdentificationParameters.of(vehicle, section)
        self.identification = ThrustIdentification(thrust)
        self.sequence = OffboardSequence(OffboardParameters.among(section))
        self._repeats = Repeats()
        self._source = SetpointSource(self.map, HoldParameters.among(section))
        self.autopilot = Autopilot(Parameters.of(vehicle))
        self.setpoint = np.zeros(4)
        self.factor = 1.0
        self.passes: Callable[[], bool] = lambda: True  # whether a message reaches the autopilot
        self.receives: Callable[[], bool] = lambda: True  # whether one of the autopilot arrives
        self._received_at = 0.0  # stamp [s] of the last one

    @property
    def armed_since(self) -> float | None:
        """Stamp [s] at which the autopilot was first seen armed, None while it is not."""
        return self.sequence.armed_stamp if self.autopilot.commander.armed else None

    def connected(self, stamp: float) -> bool:
        """Whether a heartbeat came within the last seconds before `stamp` [s]."""
        return stamp - self._received_at < HEARTBEAT_TIMEOUT

    def send(
        self,
        stamp: float,
        time: float,
        tau_p: np.ndarray,
        tau_q: np.ndarray,
        state: np.ndarray,
        flying: bool,
        wanted: MissionOutput,
        mocap: tuple | None,
    ) -> None:
        """One tick of the bridge: vision, requests, setpoint.

        stamp: of the tick's IMU sample [s], the bridge's clock; time: the autopilot's [s]; wanted:
        the mission's output.
        """
        autopilot, setpoint = self.autopilot, self.setpoint
        if mocap is not None and not self._frozen(mocap) and self.passes():
            autopilot.vision(time, swap_world(mocap[1]), swap_quaternion(mocap[2]))
        if self.receives():
            self._received_at = stamp
        self.sequence.want(wanted.arm)
        self.sequence.let_go = wanted.state is State.FAILSAFE
        status = autopilot.commander
        request = self.sequence.update(stamp, self.connected(stamp), status.armed, status.mode)
        if request is not None and self.passes():
            self._request(time, request)
        situation = Situation(status.armed, autopilot.landing.landed, self.sequence.let_go)
        self._source.note_state(stamp, state)
        command = self._source.commanded(
            stamp, state, flying, tau_p, tau_q if flying else None, situation
        )
        setpoint[:] = 0.0
        if command is not None:
            setpoint[0:3], setpoint[3] = command
        if command is not None and self.passes():
            autopilot.setpoint(time, swap_body(setpoint), setpoint[3])
        thrust, self.factor = float(setpoint[3]), self.map.thrust_factor
        self.map.thrust_factor = self.identification.update(
            stamp, state, thrust, self.map.assumed_thrust(thrust), flying and status.armed
        )

    def _frozen(self, mocap: tuple) -> bool:
        return self._repeats(mocap[1], mocap[2]) and self.autopilot.commander.armed

    def _request(self, time: float, request: Request) -> None:
        if request is Request.OFFBOARD:
            result = self.autopilot.command(
                time, MavCmd.DO_SET_MODE, (CUSTOM_MODE_ENABLED, *Mode.OFFBOARD.value)
            )
        else:
            result = self.autopilot.command(
                time, MavCmd.ARM_DISARM, (float(request is Request.ARM), 0.0)
            )
        self.sequence.answer(request, result)

    def autopilot_tick(self, hil: tuple) -> np.ndarray:
        """One cycle of the autopilot on its own IMU sample; returns the motor commands (n,)."""
        stamp, gyro, force = hil
        return self.autopilot.update(stamp, swap_body(gyro), swap_body(force))
