"""`uam view`: the cockpit for nodes that run already, of `uam fly` or on the vehicle."""

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
  uam view                                 the flight that is under way
  ROS_DOMAIN_ID=5 uam view                 nodes that uam fly did not start, as on the vehicle
  uam view --host 0.0.0.0                  for browsers on other computers, too: anyone who reaches
                                           this port can then steer the vehicle
  uam view --origin http://lab:9000        a page served from elsewhere may connect as well

The 3-D scene needs the node `scene`, which uam fly starts: ros2 run uam_sim_bridge scene.
Ctrl-C ends it; the flight goes on.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "view",
        help="the cockpit, a local web page, for nodes that run already",
        description="Serve the cockpit: the scene, charts, gains and commands in a browser.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    option = parser.add_argument
    option(
        "--instance",
        type=int,
        metavar="N",
        help=f"of the flight, 0..{INSTANCES - 1} (default: the one that is under way)",
    )
    option(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address to listen on (default %(default)s: this computer alone)",
    )
    option(
        "--port",
        type=_port,
        default=8080,
        metavar="PORT",
        help="the first free one from this on (default %(default)s)",
    )
    option(
        "--origin",
        action="append",
        default=[],
        metavar="URL",
        help="of other pages that may connect; may be given again",
    )
    parser.set_defaults(run=run)


def _port(text: str) -> int:
    if not (text.isdecimal() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text} is not a port (0..65535)")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C; returns the exit status."""
    try:
        require_ros()
        domain = domain_of_flight(options.instance)
    except (PortError, SettingsError) as error:
        print(f"uam view: {error}", file=sys.stderr)
        return WRONG_USE
    from uam_lab.nodes import cockpit
    from uam_lab.processes.node_environment import transport_environment

    if domain is not None:  # of uam fly; else the user's own
        os.environ.update(transport_environment(), ROS_DOMAIN_ID=str(domain))
    given = {"host": options.host, "port": options.port, "origins": ",".join(options.origin)}
    texts = [f"{name}:={json.dumps(value)}" for name, value in given.items() if value != ""]
    parameters = [word for text in texts for word in ("-p", text)]
    sys.argv = ["cockpit", "--ros-args", "--disable-external-lib-logs", *parameters]
    return cockpit.main()
