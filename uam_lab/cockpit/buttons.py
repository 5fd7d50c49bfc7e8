"""The buttons of the commands on the page beside the scene, and the field for a goal."""

from __future__ import annotations

import viser

from uam_lab.cockpit.commands import BUTTONS, GOAL, Button, Commands, Later
from uam_lab.cockpit.texts import shown


class CommandButtons:
    """The buttons on the page. `later` passes a click to the thread that processes it."""

    def __init__(self, gui: viser.GuiApi, commands: Commands, later: Later):
        self._gui, self._commands, self._later = gui, commands, later
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
        with gui.add_form(None) as form:
            goal = gui.add_text("Go to", "", hint=f"{GOAL}; height and heading may be left out")
            send = gui.add_button("Go", icon=viser.Icon.MAP_PIN)
        for sent in (form.on_submit, send.on_click):
            sent(lambda _: later(lambda: commands.goto(goal.value)))

    def look(self) -> None:
        """Enable the buttons that the present state allows; the others say why not."""
        for button, handle in self._handles:
            why = self._commands.refusal(button)
            hint = f"{button.hint}: {why}" if why else button.hint
            if (handle.disabled, handle.hint) != (bool(why), hint):
                handle.disabled, handle.hint = bool(why), hint

    def _pressed(self, button: Button) -> None:
        question = self._commands.question(button)
        if not question:
            self._commands.call(button)
            return
        with self._gui.add_modal(button.label) as modal:
            self._gui.add_html(shown([question]))
            # first, as the browser gives it the keyboard: Enter and space must not confirm
            no = self._gui.add_button("Cancel")
            yes = self._gui.add_button(button.label, color=button.colour)

        def agreed(_: viser.GuiEvent) -> None:
            modal.close()
            self._later(lambda: self._commands.call(button))

        yes.on_click(agreed)
        no.on_click(lambda _: modal.close())
