"""The checklist of a real vehicle on the page: present step, open items, two buttons."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import viser
from std_srvs.srv import Trigger

from uam_lab.cockpit.commands import Later, Said
from uam_lab.cockpit.headline import COLOURS, MARKS
from uam_lab.cockpit.services import Services
from uam_lab.cockpit.vehicle_health import BAD, CAUTION, GOOD, UNKNOWN
from uam_lab.records.results import templates
from uam_msgs_py.messages.checklist import FAILED, OPEN, PASSED, ChecklistItem, read_items
from uam_msgs_py.messages.status import ChecklistState

LEVELS = {PASSED: GOOD, FAILED: BAD, OPEN: UNKNOWN}
TOP = -1.0  # place on the panel: above the headline
ACTIONS = (("Confirm", "confirm", "CHECK"), ("Repeat the step", "repeat", "REPEAT"))


def checklist_html(state: ChecklistState, items: Sequence[ChecklistItem]) -> str:
    """Return the HTML: the present step, and the items that have not passed."""
    rows = []
    for item in items:
        if item.result == PASSED:
            continue
        level = CAUTION if item.name == state.step and not state.failed else LEVELS[item.result]
        rows.append((level, MARKS[level], item.name, item.value, item.limit))
    return templates.render(
        "uam_lab.cockpit",
        "checklist.html.j2",
        colours=COLOURS,
        state=state,
        rows=rows,
        passed=sum(item.result == PASSED for item in items),
        count=len(items),
    )


class ChecklistPanel:
    """A folder at the top of the page; it appears with the first message of a checklist."""

    def __init__(
        self,
        gui: viser.GuiApi,
        services: Services,
        later: Later,
        said: Said,
    ) -> None:
        """later: passes a click to the thread that processes it; said: gets the answers."""
        self._gui, self._services, self._later, self._said = gui, services, later, said
        self._html: viser.GuiHtmlHandle | None = None
        self._buttons: dict[str, Any] = {}
        self._shown = ""

    def show(self, message: Any) -> None:
        """Show a message of /uam/checklist."""
        state = ChecklistState.from_message(message)[1]
        shown = checklist_html(state, read_items(message))
        if self._html is None:
            self._create()
        if shown != self._shown:
            self._html.content = self._shown = shown
        for name, enabled in (("confirm", state.needs == "confirm"), ("repeat", True)):
            if self._buttons[name].disabled == enabled:
                self._buttons[name].disabled = not enabled

    def _create(self) -> None:
        with self._gui.add_folder("Checklist", order=TOP):
            self._html = self._gui.add_html("")
            for label, name, icon in ACTIONS:
                button = self._gui.add_button(label, icon=getattr(viser.Icon, icon))
                button.on_click(lambda _, name=name: self._later(partial(self._call, name)))
                self._buttons[name] = button

    def _call(self, name: str) -> None:
        def answered(response: Trigger.Response | None, why: str) -> None:
            done = response is not None and response.success
            self._said(done, f"checklist: {why or response.message}")

        self._services.call(Trigger, f"checklist/{name}", Trigger.Request(), answered)
