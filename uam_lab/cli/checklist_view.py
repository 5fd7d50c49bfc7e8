"""The checklist in a terminal, drawn by rich."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from uam_msgs_py.messages.checklist import FAILED, OPEN, PASSED, ChecklistItem
from uam_msgs_py.messages.status import ChecklistState

MARKS = {PASSED: ("ok", "green"), FAILED: ("FAIL", "bold red"), OPEN: ("open", "yellow")}
KEYS = "c or Enter: confirm    r: repeat    q: quit"


def drawn(
    state: ChecklistState,
    items: Sequence[ChecklistItem],
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
    fine = [one for one in items if one.kind == "automatic" and one.result == PASSED]
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


def _table(state: ChecklistState, items: Sequence[ChecklistItem]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("", "item", "value", "limit"):
        table.add_column(name, overflow="fold")
    for item in items:
        mark, style = MARKS[item.result]
        if item.name == state.step:
            mark, style = "-->", "bold cyan" if not state.failed else "bold red"
        table.add_row(Text(mark, style=style), item.name, item.value, item.limit)
    return table
