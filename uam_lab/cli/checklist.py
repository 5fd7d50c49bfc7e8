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
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from uam_control.settings.preflight_check import AUTOMATIC, PreflightCheck
from uam_lab.cli.command import Command, guest_of
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.records.results.terminal import Terminal, say
from uam_msgs_py.messages.status import ChecklistState

if TYPE_CHECKING:
    from uam_lab.flights.operator import Operator

DONE, OPEN_ITEMS = 0, 1  # exit status
SHOW, CONFIRM, REPEAT, LIVE = "show", "confirm", "repeat", "live"
PERIOD = 0.2  # [s] between two pictures
MARKS = {True: ("ok", "green"), False: ("FAIL", "bold red"), None: ("open", "yellow")}
KEYS = "c or Enter: confirm    r: repeat    q: quit"


def add(command: Command) -> None:
    text = "show: print it once; without: live"
    choices = (LIVE, SHOW, CONFIRM, REPEAT)
    command.option("what", None, text, LIVE, nargs="?", choices=choices)
    command.instance()


def run(options: argparse.Namespace) -> int:
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
    return DONE if accepted else OPEN_ITEMS


def _show(operator: Operator) -> int:

    state, items = operator.checklist()
    Terminal().print(drawn(state, items))
    return DONE if state.passed else OPEN_ITEMS


def _live(operator: Operator) -> int:
    """Draw the checklist until q is pressed, or without a terminal until all items have passed."""
    from rich.live import Live

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
    return DONE if state.passed else OPEN_ITEMS


def drawn(
    state: ChecklistState,
    items: Sequence[PreflightCheck],
    answer: str = "",
    live: bool = False,
    keys: bool = False,
) -> RenderableType:
    """Return the present step above the table of items.

    answer: of the last command; live: passed automatic items are only counted, as a terminal is not
    high; keys: whether they are explained.
    """
    parts: list[RenderableType] = [_step(state)]
    if keys:
        parts.append(Text(KEYS, style="dim"))
    if answer:
        parts.append(Text(answer))
    fine = [one for one in items if one.kind == AUTOMATIC and one.passed]
    if live and fine:
        parts.append(Text(f"{len(fine)} automatic items pass", style="green"))
        items = [one for one in items if one not in fine]
    return Group(*parts, _table(state, items))


def _step(state: ChecklistState) -> Panel:
    if state.passed:
        return Panel("All items have passed: uam start is allowed.", style="green")
    if not state.step:
        return Panel(Text(f"Waiting for: {state.failing}"), title="automatic items", style="yellow")
    lines = [Text(state.instruction, style="bold"), Text(state.seen)]
    if state.needs == "confirm":
        lines.append(Text("Confirm when it is done.", style="bold yellow"))
    return Panel(Group(*lines), title=Text(state.step), style="red" if state.failed else "cyan")


def _table(state: ChecklistState, items: Sequence[PreflightCheck]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("", "item", "value", "limit"):
        table.add_column(name, overflow="fold")
    for item in items:
        mark, style = MARKS[item.passed]
        if item.name == state.step:
            mark, style = "-->", "bold cyan" if not state.failed else "bold red"
        table.add_row(Text(mark, style=style), item.name, item.value, item.limit)
    return table
