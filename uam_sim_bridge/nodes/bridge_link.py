"""The bridge's links: to the autopilot, its magnet, and a ground station."""

import time
from collections.abc import Callable

from uam_control.offboard.autopilot_magnet import NONE, AutopilotMagnet, AutopilotMagnetParameters
from uam_control.offboard.firmware import Firmware
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_sim_bridge.devices.magnet.lines import SwitchingParameters
from uam_sim_bridge.faults import LINK, Schedule
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Signing, mavlink2
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE, RequiredParameters
from uam_sim_bridge.mavlink.transport.faulty_transport import (
    FaultyTransport,
    GroundStation,
)
from uam_sim_bridge.mavlink.transport.transport import (
    Transport,
    UdpTransport,
    open_transport,
    parse_url,
)
from uam_sim_bridge.nodes.bridge_parameters import AUTO, BridgeParameters
from uam_sim_bridge.nodes.magnet_driver import MagnetTopics
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay

EXIT_TIME = 1.0  # [s] for the acknowledgement at the node's end
EXIT_STEP = 0.02  # [s] between two looks for it


def open_links(
    options: BridgeParameters,
    sequence: OffboardSequence,
    mapping: RateThrustParameters,
    imu_rate: float = 0.0,
    clock: Callable[[], float] | None = None,
) -> tuple[OffboardLink, GroundStation | None, FaultyTransport | None]:
    """Open and return the links, None if not configured; imu_rate, clock: see OffboardLink.

    Raises PortError, ParameterError, FaultError in one line.
    """
    system = options.autopilot_system
    url = options.autopilot
    signing = Signing.from_text(options.signing_key, options.signing_link_id)
    required = _required(options.required_parameters, url, sequence.firmware)
    faults = Schedule.from_text(options.faults).only(LINK)
    delay = SetpointDelay.from_text(options.network_delay)
    transport: Transport
    if url:
        transport = open_transport(url, absent=options.wait_for_device)
    else:
        transport = UdpTransport(
            options.local_port, (options.autopilot_host, options.autopilot_port)
        )
    faulty = station = None
    if faults or delay is not None:
        transport = faulty = FaultyTransport(transport, faults, delay)
    if options.gcs:
        codec = Codec(system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER, signing)
        transport = station = GroundStation(options.gcs, transport, codec)
    link = OffboardLink(transport, sequence, mapping, system, signing, imu_rate, clock, required)
    link.parameters.writing = options.set_parameters
    return link, station, faulty


def _required(given: str, url: str, spoken: Firmware) -> RequiredParameters | None:
    """Return the required parameters that the bridge's parameter names, None for none."""
    name = given
    if given == AUTO:
        name = VEHICLE if url and parse_url(url).real else NONE
    return None if name == NONE else RequiredParameters.read(name, spoken)


class BridgeMagnet(MagnetTopics):
    """Joins commands, link and state. Times [s] are those of the ticks."""

    def __init__(
        self, node: UamNode, link: OffboardLink, magnet: AutopilotMagnet, rules: SwitchingParameters
    ) -> None:
        self._node, self._link, self._magnet = node, link, magnet
        self._time = 0.0
        super().__init__(node, rules, lambda: self._time)

    def update(self, tick: float) -> None:
        """Take the commands that have arrived by `tick`, and publish the state."""
        self._time = tick
        self._node.take_waiting(self.subscription)
        self._magnet.switch(tick, self.switching.desired(tick))
        self.publish(tick, self._magnet.state)

    def end(self, tick: float) -> None:
        """Leave the magnet as `magnet_at_exit` says; wait at most EXIT_TIME for the answer.

        tick: the last one. An autopilot that never answered is not waited for.
        """
        self._magnet.switch(tick, self.switching.at_exit())
        begun = time.monotonic()
        while not self._magnet.settled and (spent := time.monotonic() - begun) < EXIT_TIME:
            if not self._link.connected(tick + spent):
                return
            self._link.send_magnet(tick + spent)
            time.sleep(EXIT_STEP)
            self._link.poll(tick + spent)

    def problems(self) -> tuple[str, ...]:
        """Return one line per problem."""
        found = (self._magnet.problem, self.problem(self._time))
        return tuple(text for text in found if text)

    def values(self) -> dict[str, object]:
        """Return the values for /diagnostics."""
        return {"magnet": self._magnet.state, "magnet commands sent": self._magnet.requests}


def bridge_magnet(node: UamNode, link: OffboardLink) -> BridgeMagnet | None:
    """Declare the parameters and return the magnet; None if it is not the autopilot's."""
    parameters = NodeParameters(node, AutopilotMagnetParameters, read_only=True).current
    rules = NodeParameters(node, SwitchingParameters, read_only=True).current
    if parameters.magnet == NONE:
        return None
    link.magnet = AutopilotMagnet(parameters)
    return BridgeMagnet(node, link, link.magnet, rules)
