"""The bridge's links: to the autopilot, and to a ground station."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from uam_control.offboard.firmware import Firmware
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_sim_bridge.faults import LINK, Schedule
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.signing import Signing
from uam_sim_bridge.mavlink.protocol.wire import Codec, mavlink2
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE, RequiredParameters
from uam_sim_bridge.mavlink.transport.faulty_transport import FaultyTransport, LateTransport
from uam_sim_bridge.mavlink.transport.forwarding import GroundStation
from uam_sim_bridge.mavlink.transport.transport import (
    Transport,
    UdpTransport,
    open_transport,
    parse_url,
)
from uam_sim_bridge.nodes.bridge_parameters import AUTO, NONE, BridgeParameters
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay


@dataclass(frozen=True)
class Links:
    """The open links; station, faulty, late: None if not configured. waits: for a device."""

    autopilot: OffboardLink
    station: GroundStation | None
    faulty: FaultyTransport | None
    late: LateTransport | None
    waits: bool


def open_links(
    options: BridgeParameters,
    sequence: OffboardSequence,
    mapping: RateThrustParameters,
    imu_rate: float = 0.0,
    clock: Callable[[], float] | None = None,
) -> Links:
    """Open the links; imu_rate, clock: see OffboardLink.

    Raises PortError, ParameterError, FaultError in one line.
    """
    system = options.autopilot_system
    url = options.autopilot
    signing = Signing.from_text(options.signing_key, options.signing_link_id)
    required = _required(options.required_parameters, url, sequence.firmware)
    faults = Schedule.from_text(options.faults).only(LINK)
    delay = SetpointDelay.from_text(options.network_delay)
    transport: Transport
    waits = options.wait_for_device
    if url:
        transport = open_transport(url, absent=waits)
    else:
        transport = UdpTransport(
            options.local_port, (options.autopilot_host, options.autopilot_port)
        )
    faulty = station = late = None
    if delay is not None:
        transport = late = LateTransport(transport, delay)
    if faults:
        transport = faulty = FaultyTransport(transport, faults)
    if options.gcs:
        codec = Codec(system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER, signing)
        transport = station = GroundStation(options.gcs, transport, codec)
    link = OffboardLink(transport, sequence, mapping, system, signing, imu_rate, clock, required)
    link.parameters.writing = options.set_parameters
    return Links(link, station, faulty, late, waits)


def _required(given: str, url: str, spoken: Firmware) -> RequiredParameters | None:
    """Return the required parameters that the bridge's parameter names, None for none."""
    name = given
    if given == AUTO:
        name = VEHICLE if url and parse_url(url).real else NONE
    return None if name == NONE else RequiredParameters.read(name, spoken)
