"""The bridge's links: to the autopilot, and to a ground station."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from uam_control.ages import STALE
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.settings.parameter_set import ParameterSet, Text, choice, integer, number, switch
from uam_msgs_py.node.node_parameters import NodeParameters, declared_text
from uam_msgs_py.node.tunable import TunableNode
from uam_sim_bridge.faults import LINK, Schedule
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.signing import Signing
from uam_sim_bridge.mavlink.protocol.wire import Codec, mavlink2
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE, RequiredParameters
from uam_sim_bridge.mavlink.transport.faulty_transport import FaultyTransport
from uam_sim_bridge.mavlink.transport.forwarding import GroundStation
from uam_sim_bridge.mavlink.transport.late_transport import LateTransport
from uam_sim_bridge.mavlink.transport.transport import (
    Transport,
    UdpTransport,
    open_transport,
    parse_url,
)
from uam_sim_bridge.nodes.late_device import DeviceWait
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay


@dataclass(frozen=True)
class BridgeParameters(ParameterSet):
    """Ports and times of the bridge; they cannot change while the node runs."""

    clock: str = choice(
        "lockstep",
        "lockstep: only ticks; realtime: also a watchdog on wall time",
        ("lockstep", "realtime"),
    )
    local_port: int = integer(14540, "own UDP port (14540 + instance)", 1, 65535)
    autopilot_port: int = integer(14580, "UDP port of the autopilot (14580 + instance)", 1, 65535)
    autopilot_system: int = integer(1, "MAVLink system id of the autopilot", 1, 255)
    signing_link_id: int = integer(0, "number of this link in MAVLink 2 signatures", 0, 255)
    autopilot_parameters: str = choice(
        "warn",
        "where the autopilot's MC_*RATE_P/K or THR_MDL_FAC differ from the mapping: warn, "
        "or adopt them before arming",
        ("warn", "adopt"),
    )
    set_parameters: bool = switch(
        False,
        "write the required parameters with one allowed value to the autopilot before it is armed; "
        "for an autopilot in software only",
    )
    dry_run: bool = switch(
        False, "compute and publish setpoints; send the autopilot none, and never arm it"
    )
    kill_confirmation: float = number(
        3.0, "time within which the second call of /mission/kill must come", "s", 0.5, 30.0
    )
    imu_source: str = choice(
        "topic",
        "IMU of the estimator: topic, from another node; autopilot: this node requests it from the "
        "autopilot and publishes it",
        ("topic", "autopilot"),
    )
    imu_clock: str = choice(
        "system",
        "clock of the stamps of the autopilot's IMU: system, or topic: /clock of a simulator",
        ("system", "topic"),
    )
    stale_after: float = number(
        STALE, "time without a command after which commands count as lost", "s", 0.01, 5.0
    )


AUTO, NONE = "auto", "none"  # values of required_parameters


@dataclass(frozen=True)
class Links:
    """The open links; station, faulty, late: None if not configured. waits: for a device."""

    autopilot: OffboardLink
    station: GroundStation | None
    faulty: FaultyTransport | None
    late: LateTransport | None
    waits: bool


def open_links(
    node: TunableNode,
    options: BridgeParameters,
    sequence: OffboardSequence,
    mapping: RateThrustParameters,
    imu_rate: float = 0.0,
    clock: Callable[[], float] | None = None,
) -> Links:
    """Declare the parameters of the links, and open the links; imu_rate, clock: see OffboardLink.

    Raises PortError, ParameterError, FaultError in one line.
    """
    system = options.autopilot_system
    host = declared_text(
        node,
        "autopilot_host",
        "127.0.0.1",
        Text("host of the autopilot's UDP port, used if `autopilot` is empty", "name or address"),
    )
    url = declared_text(
        node,
        "autopilot",
        "",
        Text(
            "link to the autopilot, in place of the UDP port",
            "udp:HOST:PORT[:LOCAL_PORT], tcp:HOST:PORT or serial:DEVICE:BAUD; empty: none",
        ),
    )
    watching = declared_text(
        node, "gcs", "", Text("link to a ground station", "udp:HOST:PORT[:LOCAL_PORT]; empty: none")
    )
    key = declared_text(
        node,
        "signing_key",
        "",
        Text("MAVLink 2 signing; shown as 'set'", "64 hex digits, or a file with them"),
        secret=True,
    )
    signing = Signing.from_text(key, options.signing_link_id)
    required = _required(
        declared_text(
            node,
            "required_parameters",
            AUTO,
            Text(
                "parameters of the autopilot to compare and report; none is written",
                f"a list of config/px4, as {VEHICLE}, or a YAML file; {NONE}; {AUTO}: {VEHICLE} on "
                f"a serial line or for another host, else {NONE}",
            ),
        ),
        url,
    )
    planned = declared_text(
        node,
        "faults",
        "",
        Text(
            "faults of the MAVLink connection with their times",
            "JSON, see docs/faults.md; empty: none",
        ),
    )
    faults = Schedule.from_text(planned).only(LINK)
    network = declared_text(
        node,
        "network_delay",
        "",
        Text(
            "simulated delay of the messages to the autopilot",
            'JSON, {"fixed", "jitter", "longest" [s], "seed"}: docs/plant.md; empty: none',
        ),
    )
    delay = SetpointDelay.from_text(network)
    transport: Transport
    waits = NodeParameters(node, DeviceWait, read_only=True).current.wait_for_device
    if url:
        transport = open_transport(url, absent=waits)
    else:
        transport = UdpTransport(options.local_port, (host, options.autopilot_port))
    faulty = station = late = None
    if delay is not None:
        transport = late = LateTransport(transport, delay)
    if faults:
        transport = faulty = FaultyTransport(transport, faults)
    if watching:
        codec = Codec(system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER, signing)
        transport = station = GroundStation(watching, transport, codec)
    link = OffboardLink(transport, sequence, mapping, system, signing, imu_rate, clock, required)
    link.parameters.writing = options.set_parameters
    return Links(link, station, faulty, late, waits)


def _required(given: str, url: str) -> RequiredParameters | None:
    """Return the required parameters that the bridge's parameter names, None for none."""
    name = given
    if given == AUTO:
        name = VEHICLE if url and parse_url(url).real else NONE
    return None if name == NONE else RequiredParameters.read(name)
