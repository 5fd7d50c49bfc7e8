"""`uam profile`: switch the profile of a running flight."""

from __future__ import annotations

import argparse
from typing import Any

from uam_control.profiles.profile import Profile, load_profile
from uam_control.settings import configuration
from uam_lab.cli.command import Command, Subcommands, chosen_flight
from uam_lab.flights.flight_settings import SettingsError, require_ros
from uam_lab.records.results.terminal import say

CHANGED, REFUSED = 0, 1
EXAMPLES = """\
examples:
  uam profile mine.yaml                    the running flight; all nodes accept it, or none
  uam profile s500 --instance 2            one of several flights
  ROS_DOMAIN_ID=5 uam profile mine.yaml    nodes not started by uam fly
  ros2 param dump /arm_controller > arm.yaml; uam profile s500 arm.yaml    a later file overrides

Adapted gains, filters and the desired attitude stay unchanged; the outputs change because the new
gains act on the same errors (docs/tuning.md). The log records every change.
"""


def add(commands: Subcommands) -> None:
    """Add the subcommand to the command line."""
    command = Command(
        commands,
        "profile",
        run,
        "switch the profile of a running flight",
        "Switch the profile of a running flight: all nodes apply it, or none.",
        EXAMPLES,
    )
    text = f"{', '.join(configuration.names('profiles'))}, or a ROS parameter file"
    command.option("profile", "NAME|FILE", text, nargs="+")
    command.instance()


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    require_ros()
    given = [str(configuration.named("profiles", one)) for one in options.profile]
    domain, namespace = chosen_flight(options)
    return switch(load_profile(*given, namespace=namespace), domain, namespace)


def switch(profile: Profile, domain: int | None, namespace: str = "/") -> int:
    """Switch the nodes of a vehicle, print the changes; return the exit status.

    Raises SettingsError if none of them is there.
    """
    from uam_lab.flights.operator import NoFlight
    from uam_lab.flights.processes.guest import Guest
    from uam_lab.flights.processes.node_environment import transport_environment
    from uam_lab.flights.ros.profile_switch import (
        ProfileSwitch,
        SwitchIncomplete,
        SwitchRefused,
    )

    environment = {} if domain is None else transport_environment()  # of uam fly, or the user's
    with Guest("uam_profile", environment, domain, namespace) as guest:
        try:
            changed = ProfileSwitch(guest.node).switch(profile)
        except NoFlight as error:
            raise SettingsError(str(error)) from None
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
