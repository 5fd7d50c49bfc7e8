"""`uam teleop`: move the hand by keys.

Move the end effector by keys, switch its gripper, hold. Needs a terminal.

examples:
  uam teleop                          keys of config/teleop/gamepad.yaml: w a s d, r f, q e, ...
  uam teleop --mapping my_keys.yaml   keys of your own
  ros2 run uam_control teleop         a gamepad: with ros2 run joy joy_node

A key moves the hand while it is held; without one the hand stops. x or Ctrl-C ends.
"""

import argparse
import time

from uam_control.stages.gamepad import DEFAULT, Keys, Mapping
from uam_lab.cli import keys
from uam_lab.cli.command import Command, guest_of
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.records.results.terminal import say

END = "x"


def add(command: Command) -> None:
    command.instance()
    text = "name of a file in config/teleop, or a file"
    command.option("--mapping", "NAME|FILE", text, DEFAULT)


def run(options: argparse.Namespace) -> int:
    mapping = Mapping.read(options.mapping)
    with keys.Keys() as pressed:
        if not pressed.available:
            raise SettingsError("teleop needs a terminal; a gamepad: ros2 run uam_control teleop")
        _serve(options, mapping, pressed)
    return 0


def _serve(options: argparse.Namespace, mapping: Mapping, pressed: keys.Keys) -> None:
    with guest_of(options) as guest:
        from uam_control.nodes.teleop import Teleop
        from uam_lab.flights.operator import Operator

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
