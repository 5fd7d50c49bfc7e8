"""`uam view`: the cockpit for running nodes, of `uam fly` or on the vehicle."""

from __future__ import annotations

import argparse
import json
import os
import sys

from uam_lab.flight.settings import SettingsError, require_ros
from uam_sim_bridge.ports import INSTANCES, PortError, domain_of_flight

WRONG_USE = 2
EXAMPLES = """\
examples:
  uam view                                 the running flight
  ROS_DOMAIN_ID=5 uam view                 nodes not started by uam fly, as on the vehicle
  uam view --host 0.0.0.0                  also for browsers on other computers: everyone with
                                           access to this port can then command the vehicle
  uam view --origin http://lab:9000        allow connections of a page from another server

The 3-D scene needs the node `scene`: uam fly starts it, otherwise ros2 run uam_lab scene.
Ctrl-C ends the cockpit; the flight continues.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "view",
        help="the cockpit, a local web page, for running nodes",
        description="Serve the cockpit: the scene, charts, gains and commands in a browser.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    option = parser.add_argument
    option(
        "--instance",
        type=int,
        metavar="N",
        help=f"instance of the flight, 0..{INSTANCES - 1} (default: the running one)",
    )
    option(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address to listen on (default %(default)s: this computer only)",
    )
    option(
        "--port",
        type=_port,
        default=8080,
        metavar="PORT",
        help="first port to try; the next free one is used (default %(default)s)",
    )
    option(
        "--origin",
        action="append",
        default=[],
        metavar="URL",
        help="origin of another page that may connect; may be repeated",
    )
    parser.set_defaults(run=run)


def _port(text: str) -> int:
    if not (text.isdecimal() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text} is not a port (0..65535)")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C; return the exit status."""
    try:
        require_ros()
        domain = domain_of_flight(options.instance)
    except (PortError, SettingsError) as error:
        print(f"uam view: {error}", file=sys.stderr)
        return WRONG_USE
    from uam_lab.nodes import cockpit
    from uam_lab.processes.node_environment import transport_environment

    if domain is not None:  # a flight of uam fly; otherwise the user's environment
        os.environ.update(transport_environment(), ROS_DOMAIN_ID=str(domain))
    given = {"host": options.host, "port": options.port, "origins": ",".join(options.origin)}
    texts = [f"{name}:={json.dumps(value)}" for name, value in given.items() if value != ""]
    parameters = [word for text in texts for word in ("-p", text)]
    sys.argv = ["cockpit", "--ros-args", "--disable-external-lib-logs", *parameters]
    return cockpit.main()
