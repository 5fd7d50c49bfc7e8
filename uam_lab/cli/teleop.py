"""`uam teleop`: the hand by the keys of a terminal, without a gamepad."""

from __future__ import annotations

import argparse
import time

from uam_control.stages.gamepad import DEFAULT, Keys, Mapping, MappingError
from uam_lab.cli import keys
from uam_lab.cli.command import Command, Subcommands, chosen_flight
from uam_lab.flights.flight_settings import SettingsError, require_ros
from uam_lab.records.results.terminal import say

END = "x"
EXAMPLES = """\
examples:
  uam teleop                          keys of config/teleop/gamepad.yaml: w a s d, r f, q e, ...
  uam teleop --mapping my_keys.yaml   keys of your own
  ros2 run uam_control teleop         a gamepad: with ros2 run joy joy_node

A key moves the hand while it is held; without one the hand stops. x or Ctrl-C ends.
"""


def add(commands: Subcommands) -> None:
    """Add the subcommand to the command line."""
    command = Command(
        commands,
        "teleop",
        run,
        "move the hand by keys",
        "Move the end effector by keys, switch its gripper, hold. Needs a terminal.",
        EXAMPLES,
    )
    command.instance()
    text = "name of a file in config/teleop, or a file"
    command.option("--mapping", "NAME|FILE", text, DEFAULT)


def run(options: argparse.Namespace) -> int:
    """Send keys until the end; return the exit status."""
    require_ros()
    try:
        mapping = Mapping.read(options.mapping)
    except MappingError as error:
        raise SettingsError(str(error)) from None
    with keys.Keys() as pressed:
        if not pressed.available:
            raise SettingsError("teleop needs a terminal; a gamepad: ros2 run uam_control teleop")
        _serve(options, mapping, pressed)
    return 0


def _serve(options: argparse.Namespace, mapping: Mapping, pressed: keys.Keys) -> None:
    from uam_control.nodes.teleop import Teleop
    from uam_lab.flights.operator import Operator
    from uam_lab.flights.processes.guest import Guest
    from uam_lab.flights.processes.node_environment import transport_environment

    domain, namespace = chosen_flight(options)
    environment = {} if domain is None else transport_environment()
    with Guest("uam_teleop", environment, domain, namespace) as guest:
        operator, pad = Operator(guest.node), Keys(mapping)
        teleop, answered = Teleop(guest.node, mapping, say), operator.mission().answers
        limits = ""
        say(f"keys: {' '.join(mapping.keys)}; {END}: end")
        while True:
            while key := pressed.pressed():
                if key == END:
                    return
                pad.press(key, time.monotonic())
            if teleop.limits != limits:
                limits = teleop.limits
                say(f"at full speed: {limits}")
            teleop.hear(*pad.state(time.monotonic()))
            teleop.tick()
            operator.look(1.0 / mapping.rate)
            mission = operator.mission()
            if mission.answers != answered and ": refused" in mission.answer:
                say(mission.answer)
            answered = mission.answers
