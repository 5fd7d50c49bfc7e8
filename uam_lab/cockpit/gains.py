"""Fields and sliders for every parameter of a node, with active values and refusals."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from rcl_interfaces.msg import ParameterDescriptor

from uam_lab.cockpit.commands import Later, Said
from uam_lab.cockpit.services import RemoteParameters
from uam_lab.cockpit.texts import shown

REACH = 4.0  # end of a slider / initial value
STEPS = 400
OPEN = ("lambda_1", "lambda_2")  # parameters at the top, unfolded
INTERVAL = 0.15  # [s] minimum wall time between two requests of a slider


def text_of(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(text_of(one) for one in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def value_of(text: str, like: Any) -> Any:
    """Return the value of `text`, of the type of `like`, the current value. Raises ValueError."""
    if isinstance(like, list):
        return [_number(part) for part in text.replace(";", ",").split(",")]
    if isinstance(like, bool):
        word = text.strip().lower()
        if word not in ("true", "false"):
            raise ValueError(f"{text.strip() or 'nothing'}: true or false expected")
        return word == "true"
    if isinstance(like, int | float):
        return _number(text)
    return text.strip()


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text.strip() or 'nothing'}: a number expected") from None


def reach(about: ParameterDescriptor, value: float) -> tuple[float, float, float]:
    """Return (low, high, step) of a slider with the initial value `value`."""
    low, high = bounds(about)
    low = max(low, min(0.0, REACH * value))
    high = min(high, max(REACH * value, 1.0 if value == 0.0 else value / REACH))
    high = max(high, value)
    low = min(low, value)
    return low, high, 1.0 if about.integer_range else (high - low) / STEPS or 1.0


def bounds(about: ParameterDescriptor) -> tuple[float, float]:
    """Return the range declared by the node; for a vector that of each entry."""
    for span in about.floating_point_range:
        return span.from_value, span.to_value
    words = about.additional_constraints.removeprefix("each ").partition(";")[0].split()
    try:
        return float(words[0]), float(words[2])
    except (IndexError, ValueError):
        return -np.inf, np.inf


def choices(about: ParameterDescriptor) -> tuple[str, ...]:
    """Return the allowed words, () for another type."""
    _, marked, words = about.additional_constraints.partition("one of: ")
    return tuple(words.split(", ")) if marked else ()


def axes(about: ParameterDescriptor, count: int) -> Sequence[str]:
    """Return the names of a vector's entries from its constraints, or their numbers."""
    _, _, listed = about.additional_constraints.partition("; ")
    names = [name.strip() for name in listed.split(",") if name.strip()]
    return names if len(names) == count else [str(number) for number in range(count)]


class ParameterEntry:
    """One parameter: a folder with its meaning, a field, and a slider for each number."""

    def __init__(
        self, gui: viser.GuiApi, name: str, remote: RemoteParameters, later: Later, said: Said
    ):
        self._about = about = remote.known[name]
        self._remote, self._later, self._said = remote, later, said
        self._name, self._choices = name, choices(about)
        self._sent = 0.0
        self._desired: Any = None  # value of the sliders that is not yet requested
        value = remote.values[self._name]
        self._folder = gui.add_folder(self._label(value), expand_by_default=self._name in OPEN)
        self._sliders: list[viser.GuiSliderHandle] = []
        with self._folder:
            gui.add_html(shown([about.description, about.additional_constraints]))
            if isinstance(value, bool):
                self._field: Any = gui.add_checkbox(self._name, value)
                self._field.on_update(self._entered)
            elif self._choices:
                self._field = gui.add_dropdown(self._name, self._choices, initial_value=value)
                self._field.on_update(self._entered)
            else:
                with gui.add_form(None) as form:
                    self._field = gui.add_text(self._name, text_of(value), hint="Enter applies it")
                form.on_submit(self._entered)
                self._add_sliders(gui, value)
            self._reason = gui.add_html("", visible=False)

    def _label(self, value: Any) -> str:
        return f"{self._name} = {text_of(value)}"

    def _add_sliders(self, gui: viser.GuiApi, value: Any) -> None:
        if isinstance(value, str):
            return
        entries = value if isinstance(value, list) else [value]
        names = axes(self._about, len(entries)) if isinstance(value, list) else [self._name]
        for name, entry in zip(names, entries, strict=True):
            low, high, step = reach(self._about, float(entry))
            slider = gui.add_slider(name, low, high, step, float(entry))
            slider.on_update(self._slid)
            self._sliders.append(slider)

    def _entered(self, event: viser.GuiEvent) -> None:
        if event.client is None:  # changed by this program, not by the user
            return
        text = self._field.value
        self._later(lambda: self._ask_for(text))

    def _ask_for(self, entered: Any) -> None:
        old = self._remote.values[self._name]
        try:
            value = value_of(entered, old) if isinstance(entered, str) else entered
        except ValueError as error:
            self._refused(str(error))
            return
        self._set(value)

    def _slid(self, event: viser.GuiEvent) -> None:
        if event.client is None:
            return
        values = [slider.value for slider in self._sliders]
        vector = isinstance(self._remote.values[self._name], list)
        desired = values if vector else values[0]

        def note() -> None:
            self._desired = desired

        self._later(note)

    def look(self) -> None:
        """Request the value of the sliders, at most once per INTERVAL."""
        if self._desired is None or time.monotonic() - self._sent < INTERVAL:
            return
        desired, self._desired = self._desired, None
        self._set(desired)

    def _set(self, value: Any) -> None:
        self._sent = time.monotonic()
        if self._about.integer_range and float(value).is_integer():
            value = int(value)

        def answered(why: str) -> None:
            if why:
                self._refused(why)
                return
            self._reason.visible = False
            self.show(value)

        self._remote.set({self._name: value}, answered)

    def _refused(self, why: str) -> None:
        self._reason.content = shown([f"refused: {why}"])
        self._reason.visible = True
        self._said(False, f"{self._remote.node}: {why}")
        self.show(self._remote.values[self._name])

    def show(self, value: Any) -> None:
        self._remote.values[self._name] = value
        self._folder.label = self._label(value)
        shown = value if isinstance(value, bool) or self._choices else text_of(value)
        if self._field.value != shown:
            self._field.value = shown
        if self._desired is not None:
            return
        entries = value if isinstance(value, list) else [value]
        for slider, entry in zip(self._sliders, entries, strict=False):
            slider.max, slider.min = max(slider.max, entry), min(slider.min, entry)
            if abs(slider.value - entry) > 0.5 * slider.step:
                slider.value = float(entry)


class NodeGains:
    """A tab with all parameters of a node that may change in flight."""

    def __init__(
        self,
        gui: viser.GuiApi,
        tab: viser.GuiTabHandle,
        remote: RemoteParameters,
        later: Later,
        said: Said,
    ):
        """remote: after `load`."""
        self.remote = remote
        self._entries: dict[str, ParameterEntry] = {}
        with tab:
            for name, about in sorted(remote.known.items(), key=lambda item: item[0] not in OPEN):
                if not about.read_only and name in remote.values:
                    self._entries[name] = ParameterEntry(gui, name, remote, later, said)

    def look(self) -> None:
        """Request the values of moved sliders."""
        for entry in self._entries.values():
            entry.look()

    def changed(self, values: dict[str, Any]) -> None:
        """Show values changed by another client."""
        for name, value in values.items():
            if name in self._entries and value is not None:
                self._entries[name].show(value)
