"""Parameters of the motion capture driver, and the source that they choose."""

import platform
from dataclasses import dataclass

from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    choice,
    integer,
    number,
    text,
)
from uam_sim_bridge.devices.mocap.frame import MocapSource
from uam_sim_bridge.devices.mocap.library_source import SYSTEMS, LibrarySource
from uam_sim_bridge.devices.mocap.natnet_source import NatNetSource

NATNET, LIBRARY = "natnet", "motioncapture"


@dataclass(frozen=True)
class MocapParameters(ParameterSet):
    """Where the poses come from; they cannot change while the node runs."""

    source: str = choice(
        NATNET,
        "natnet: OptiTrack, with stamps of the exposure; motioncapture: the library of this name, "
        "for other systems, on x86-64",
        (NATNET, LIBRARY),
    )
    system: str = choice("vicon", "kind of system, with source: motioncapture", SYSTEMS)
    server: str = text("127.0.0.1", "computer of the motion capture system", "address or name")
    command_port: int = integer(1510, "command port of Motive", 1, 65535)
    local: str = text("", "own address in the network of the system", "address; empty: as routed")
    body: str = text("uam", "rigid body of the vehicle", "its name in the motion capture system")
    payload: str = text("", "rigid body of the payload", "its name; empty: not published")
    calibration: str = text(
        "motive_y_up",
        "axes of the system and the body's pivot, by uam calibrate-mocap",
        "name of a file in config/mocap, or a file",
    )
    assumed_latency: float = number(
        0.005, "exposure to arrival, where the source has no stamps of the exposure", "s", 0.0, 0.2
    )
    silent_after: float = number(
        0.25, "time without a pose after which the diagnostics say ERROR", "s", 0.02, 10.0
    )

    def check_together(self) -> None:
        """Raise ParameterError for names that cannot be."""
        if not self.body:
            raise ParameterError("body: empty; allowed: its name in the motion capture system")
        if self.payload == self.body:
            raise ParameterError(f"payload: '{self.payload}' is the vehicle's body, too")


def open_source(parameters: MocapParameters) -> MocapSource:
    """Open the source; raises MocapError, ParameterError."""
    if parameters.source == NATNET:
        return NatNetSource(parameters.server, parameters.command_port, parameters.local)
    if platform.machine() != "x86_64":
        raise ParameterError(f"source: {LIBRARY} exists for x86-64 only; use {NATNET}")
    p = parameters
    return LibrarySource(p.system, p.server, p.local, p.command_port)
