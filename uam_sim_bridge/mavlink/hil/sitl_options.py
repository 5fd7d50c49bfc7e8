"""Command line options for the ports of PX4 SITL: shared by autopilot stand-in and HITL router."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

from uam_control.vehicle import DEFAULT_VEHICLE
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.ports import AUTOPILOT_UDP, OFFBOARD_UDP, SIMULATOR_TCP


def port(text: str) -> int:
    """Return a port number; an argparse type."""
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text} is not a port (1..65535)")
    return int(text)


def instance(text: str) -> int:
    """Return a PX4 instance number; an argparse type."""
    if not text.isdecimal() or int(text) > 254:
        raise argparse.ArgumentTypeError(f"{text} is not an instance number (0..254)")
    return int(text)


def number(what: str, low: float, high: float) -> Callable[[str], float]:
    """Return an argparse type: a number from `low` to `high`; what: its name in errors."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not a {what} ({low:g}..{high:g})")
        return value

    return read


def add_instance(p: argparse.ArgumentParser) -> None:
    """Add the option of the instance number to a command line."""
    p.add_argument(
        "-i",
        "--instance",
        type=instance,
        default=0,
        metavar="N",
        help="PX4 instance number, added to the default ports (default %(default)s)",
    )


def add_vehicle(p: argparse.ArgumentParser) -> None:
    """Add the option of the vehicle to a command line."""
    p.add_argument(
        "--vehicle",
        default=DEFAULT_VEHICLE,
        metavar="NAME|FILE",
        help="description, as in config/vehicle/ (default %(default)s)",
    )


def add_port_options(p: argparse.ArgumentParser) -> None:
    """Add the options of instance, simulator and companion ports to a command line."""
    add_instance(p)
    p.add_argument(
        "--sim-host", default=HOST, metavar="HOST", help="simulator (default %(default)s)"
    )
    p.add_argument("--sim-port", type=port, metavar="PORT", help="simulator (default 4560 + N)")
    p.add_argument(
        "--mavlink-port", type=port, metavar="PORT", help="own UDP port (default 14580 + N)"
    )
    p.add_argument(
        "--companion-port",
        type=port,
        metavar="PORT",
        help="UDP destination until a peer sends a message (default 14540 + N)",
    )
    p.add_argument(
        "--wait",
        type=number("time in seconds", 0.0, 86400.0),
        default=60.0,
        metavar="SECONDS",
        help="longest wait for the simulator (default %(default)g)",
    )


def fill_ports(options: argparse.Namespace) -> None:
    """Fill in the instance's default for each port that is not given."""
    n = options.instance
    options.sim_port = options.sim_port or SIMULATOR_TCP + n
    options.mavlink_port = options.mavlink_port or AUTOPILOT_UDP + n
    options.companion_port = options.companion_port or OFFBOARD_UDP + n
