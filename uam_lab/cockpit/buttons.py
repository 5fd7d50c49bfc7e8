"""Buttons for the services of mission and controllers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import viser
from std_srvs.srv import SetBool, Trigger

from uam_control.profiles.profile import CONTROLLERS
from uam_lab.cockpit.services import Services

Later = Callable[[Callable[[], None]], None]


@dataclass(frozen=True)
class Button:
    """A button and its services. on: value of a SetBool request, None for a Trigger.

    ask: question to confirm first, "" for none. calls: of each service; kill counts at the second.
    """

    label: str
    icon: str
    services: tuple[str, ...]
    hint: str
    on: bool | None = None
    ask: str = ""
    colour: str | None = None
    calls: int = 1


def _each(service: str) -> tuple[str, ...]:
    return tuple(f"{name}/{service}" for name in CONTROLLERS)


BUTTONS = (
    Button("Start", "PLANE_DEPARTURE", ("mission/start",), "arm and take off, if the pre-arm "
           "report is green", colour="green"),
    Button("Hold", "PLAYER_PAUSE", ("mission/hold",), "stop here and stay"),
    Button("Resume", "PLAYER_PLAY", ("mission/resume",), "continue the scenario"),
    Button("Land", "ARROW_BAR_TO_DOWN", ("mission/land",), "land here", colour="orange"),
    Button("Disarm", "POWER", ("mission/disarm",), "motors off", colour="red",
           ask="Motors off: a vehicle in the air falls. Disarm?"),
    Button("Kill", "SKULL", ("mission/kill",), "motors off at once, in every state", colour="red",
           ask="The motors stop at once; a vehicle in the air falls. Kill?", calls=2),
    Button("Magnet on", "MAGNET", ("mission/magnet",), "until the scenario switches it", on=True),
    Button("Magnet off", "MAGNET_OFF", ("mission/magnet",), "drops the payload", on=False),
    Button("Freeze adaptation", "SNOWFLAKE", _each("freeze_adaptation"),
           "adapted gains stay constant", on=True),
    Button("Free adaptation", "SNOWFLAKE_OFF", _each("freeze_adaptation"),
           "adapted gains adapt again", on=False),
    Button("Reset adaptation", "REFRESH", _each("reset_adaptation"),
           "adapted gains back to their initial values"),
)  # fmt: skip


class CommandButtons:
    """The buttons on the page. `later` passes a click to the thread that processes it."""

    def __init__(
        self, gui: viser.GuiApi, services: Services, later: Later, said: Callable[[bool, str], None]
    ):
        """said: called with success and the text of the answer."""
        self._gui, self._services, self._said = gui, services, said
        self._handles = []
        for button in BUTTONS:
            handle = gui.add_button(
                button.label,
                icon=getattr(viser.Icon, button.icon),
                hint=button.hint,
                color=button.colour,
            )
            handle.on_click(lambda _, chosen=button: later(lambda: self._pressed(chosen)))
            self._handles.append((button, handle))
        self._later = later

    def look(self) -> None:
        """Enable the buttons whose services are available."""
        for button, handle in self._handles:
            kind = Trigger if button.on is None else SetBool
            there = any(self._services.ready(kind, name) for name in button.services)
            if handle.disabled == there:
                handle.disabled = not there

    def _pressed(self, button: Button) -> None:
        if not button.ask:
            self._call(button)
            return
        with self._gui.add_modal(button.label) as modal:
            self._gui.add_markdown(button.ask)
            yes = self._gui.add_button(button.label, color=button.colour)
            no = self._gui.add_button("Cancel")

        def agreed(_: viser.GuiEvent) -> None:
            modal.close()
            self._later(lambda: self._call(button))

        yes.on_click(agreed)
        no.on_click(lambda _: modal.close())

    def _call(self, button: Button) -> None:
        kind = Trigger if button.on is None else SetBool
        request = Trigger.Request() if button.on is None else SetBool.Request(data=button.on)
        for name in button.services:
            if self._services.ready(kind, name):
                self._services.call(kind, name, request, self._answer(button, name, button.calls))

    def _answer(self, button: Button, name: str, calls: int):
        def answered(response: Trigger.Response | SetBool.Response | None, why: str) -> None:
            if calls > 1 and not why:
                again = self._answer(button, name, calls - 1)
                self._services.call(Trigger, name, Trigger.Request(), again)
                return
            done = response is not None and response.success
            said = why or response.message or ("done" if done else "refused")
            node = name.strip("/").partition("/")[0]
            self._said(done, f"{button.label}: {node}: {said}")

        return answered
