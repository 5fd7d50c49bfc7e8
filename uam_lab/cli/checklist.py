"""`uam checklist`: the checklist of a real vehicle before a flight.

Show the checklist of a running vehicle, live; confirm or repeat its steps.

examples:
  uam checklist                     live, with keys: c or Enter confirms, r repeats, q ends
  uam checklist show                print it once
  uam checklist confirm             confirm the present step
  uam checklist repeat              begin the present or the last step again
  uam checklist --namespace uav1    of one of several vehicles

The steps and their limits: docs/preflight.md. Exit status: 0 all items have passed, or the command
was accepted; 1 items are open, or it was refused; 2 no flight or wrong use.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from uam_lab.cli.command import Command, Subcommands, guest_of
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.records.results.terminal import Terminal, say

if TYPE_CHECKING:
    from uam_lab.flights.operator import Operator

PASSED, OPEN = 0, 1  # exit status
SHOW, CONFIRM, REPEAT, LIVE = "show", "confirm", "repeat", "live"
PERIOD = 0.2  # [s] between two pictures


def add(commands: Subcommands) -> None:
    """Add the subcommand to the command line."""
    command = Command(commands, __doc__, run)
    text = "show: print it once; without: live"
    choices = (LIVE, SHOW, CONFIRM, REPEAT)
    command.option("what", None, text, LIVE, nargs="?", choices=choices)
    command.instance()


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with guest_of(options) as guest:
        from uam_lab.flights.operator import NoFlight, Operator

        operator = Operator(guest.node)
        try:
            if options.what in (CONFIRM, REPEAT):
                return _command(operator, options.what)
            return _show(operator) if options.what == SHOW else _live(operator)
        except NoFlight as error:
            raise SettingsError(f"{error}; only a real vehicle has a checklist") from None


def _command(operator: Operator, name: str) -> int:
    accepted, text = operator.checklist_command(name)
    say(text)
    return PASSED if accepted else OPEN


def _show(operator: Operator) -> int:
    from uam_lab.cli.checklist_view import drawn

    state, items = operator.checklist()
    Terminal().print(drawn(state, items))
    return PASSED if state.passed else OPEN


def _live(operator: Operator) -> int:
    """Draw the checklist until q is pressed, or without a terminal until all items have passed."""
    from rich.live import Live

    from uam_lab.cli.checklist_view import drawn
    from uam_lab.cli.keys import Keys

    answer = ""
    state, items = operator.checklist()
    with Keys() as keys, Live(drawn(state, items, live=True), console=Terminal()) as live:
        while True:
            key = keys.pressed()
            if key == "q":
                break
            if key in ("c", "\n", "r"):
                _, answer = operator.checklist_command(REPEAT if key == "r" else CONFIRM)
            operator.look(PERIOD)
            state, items = operator.checklist()
            live.update(drawn(state, items, answer, live=True, keys=keys.available))
            if state.passed and not keys.available:
                break
    return PASSED if state.passed else OPEN
