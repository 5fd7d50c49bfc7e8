"""`uam view`: the cockpit, a local web page, for running nodes.

Serve the cockpit: the scene, charts, gains and commands in a browser.

examples:
  uam view                                 the running flight
  ROS_DOMAIN_ID=5 uam view                 nodes not started by uam fly, as on the vehicle
  uam view --host 0.0.0.0                  also for browsers on other computers: everyone with
                                           access to this port can then command the vehicle
  uam view --origin http://lab:9000        allow connections of a page from another server

The 3-D scene needs the node `scene`: uam fly starts it, otherwise ros2 run uam_lab scene.
Ctrl-C ends the cockpit; the flight continues.
"""

import argparse
import json
import os
import sys

from uam_lab.cli.command import Command, chosen_flight
from uam_lab.flights.flight_settings import require_ros


def add(command: Command) -> None:
    command.instance()
    command.option(
        "--host", "ADDRESS", "address to listen on; the default is this computer only", "127.0.0.1"
    )
    text = "first port to try; the next free one is used"
    command.option("--port", "PORT", text, 8080, type=_port)
    command.repeated("--origin", "URL", "origin of another page that may connect")


def _port(text: str) -> int:
    if not (text.isdecimal() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text} is not a port (0..65535)")
    return int(text)


def run(options: argparse.Namespace) -> int:
    require_ros()
    domain, namespace = chosen_flight(options)
    from uam_lab.cockpit import cockpit_node
    from uam_lab.flights.processes.node_environment import transport_environment

    if domain is not None:  # a flight of uam fly; otherwise the user's environment
        os.environ.update(transport_environment(), ROS_DOMAIN_ID=str(domain))
    given = {"host": options.host, "port": options.port, "origins": ",".join(options.origin)}
    texts = [f"{name}:={json.dumps(value)}" for name, value in given.items() if value != ""]
    parameters = [word for text in texts for word in ("-p", text)]
    sys.argv = ["cockpit", "--ros-args", "--disable-external-lib-logs", *parameters]
    sys.argv += ["-r", f"__ns:={namespace}"]
    return cockpit_node.main()
