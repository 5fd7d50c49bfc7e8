"""`uam profile`: switch the profile of a running flight.

Switch the profile of a running flight: all nodes apply it, or none.

examples:
  uam profile mine.yaml                    the running flight; all nodes accept it, or none
  uam profile s500 --instance 2            one of several flights
  ROS_DOMAIN_ID=5 uam profile mine.yaml    nodes not started by uam fly
  ros2 param dump /arm_controller > arm.yaml; uam profile s500 arm.yaml    a later file overrides

Adapted gains, filters and the desired attitude stay unchanged; the outputs change because the new
gains act on the same errors (docs/tuning.md). The log records every change.
"""

import argparse
from typing import Any

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_lab.cli.command import Command, guest_of
from uam_lab.records.results.terminal import say

CHANGED, REFUSED = 0, 1


def add(command: Command) -> None:
    text = f"{', '.join(configuration.names('profiles'))}, or a ROS parameter file"
    command.option("profile", "NAME|FILE", text, nargs="+")
    command.instance()


def run(options: argparse.Namespace) -> int:
    given = [str(configuration.named("profiles", one)) for one in options.profile]
    with guest_of(options) as guest:
        from uam_lab.flights.ros.profile_switch import (
            ProfileSwitch,
            SwitchIncomplete,
            SwitchRefused,
        )

        profile = load_profile(*given, namespace=guest.node.get_namespace())
        try:
            changed = ProfileSwitch(guest.node).switch(profile)
        except SwitchRefused as refusal:
            whole = not isinstance(refusal, SwitchIncomplete)
            state = "nothing changed" if whole else "but not all nodes have their old values"
            say(f"uam profile: refused, {state}", error=True)
            for line in str(refusal).splitlines():
                say(f"  {line}", error=True)
            return REFUSED
    for node, values in changed.items():
        for name, (old, new) in values.items():
            say(f"{node}: {name}: {_text(old)} -> {_text(new)}")
    count = sum(map(len, changed.values()))
    say(
        f"{profile.name} is active: {count} values changed"
        if count
        else f"{profile.name} is already active"
    )
    return CHANGED


def _text(value: Any) -> str:
    return ", ".join(f"{one:g}" for one in value) if isinstance(value, list) else str(value)
