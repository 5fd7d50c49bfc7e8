"""`uam checklist`: what it prints, and its exit status."""

import io

import pytest

from uam_control.settings.preflight_check import PreflightCheck
from uam_lab.cli import checklist
from uam_lab.cli.checklist import drawn
from uam_lab.cli.keys import Keys
from uam_lab.records.results.terminal import Terminal
from uam_msgs_py.messages.status import ChecklistState

ITEMS = [
    PreflightCheck("battery", "90 %", "at least 60 %", True, kind="automatic"),
    PreflightCheck("radio", "unknown", "received", False, kind="automatic"),
    PreflightCheck("lift", "", "up at least 0.2 m", None, kind="guided"),
]
LIFT = ChecklistState(False, "radio; lift", "lift", "confirm", "Lift it.", "up +0.10 m")


class Operator:
    """Answers in place of a vehicle."""

    def __init__(self, *states):
        self.states, self.called, self.looks = list(states), [], 0

    def checklist(self):
        return self.states[min(self.looks, len(self.states) - 1)], ITEMS

    def checklist_command(self, name):
        self.called.append(name)
        return name == "confirm", f"{name} done"

    def look(self, seconds):
        self.looks += 1


def text(*arguments, **options):
    console = Terminal(width=100, record=True, file=io.StringIO())
    console.print(drawn(*arguments, **options))
    return console.export_text()


def test_every_item_is_shown_once_and_only_the_open_ones_live():
    shown = text(LIFT, ITEMS)
    for words in ("Lift it.", "up +0.10 m", "Confirm when it is done.", "90 %", "at least 60 %"):
        assert words in shown
    live = text(LIFT, ITEMS, "lift confirmed", live=True, keys=True)
    assert "1 automatic items pass" in live and "90 %" not in live
    assert "radio" in live and "c or Enter: confirm" in live and "lift confirmed" in live
    assert "uam start is allowed" in text(ChecklistState(True), ITEMS)
    assert "Waiting for: radio" in text(ChecklistState(False, "radio"), ITEMS)


@pytest.mark.parametrize(("state", "status"), [(LIFT, 1), (ChecklistState(True), 0)])
def test_the_exit_status_says_whether_all_items_have_passed(state, status, capsys):
    assert checklist._show(Operator(state)) == status
    assert "radio" in capsys.readouterr().out


def test_confirm_and_repeat_print_the_answer(capsys):
    operator = Operator(LIFT)
    assert checklist._command(operator, "confirm") == 0
    assert checklist._command(operator, "repeat") == 1
    assert operator.called == ["confirm", "repeat"]
    assert capsys.readouterr().out == "confirm done\nrepeat done\n"


def test_live_without_a_terminal_ends_when_all_items_have_passed(capsys):
    operator = Operator(LIFT, LIFT, ChecklistState(True))
    assert checklist._live(operator) == 0
    assert operator.looks == 2 and not operator.called


def test_keys_confirm_repeat_and_quit(monkeypatch, capsys):
    typed = iter(["c", "r", "", "\n", "q"])
    monkeypatch.setattr(Keys, "available", True)
    monkeypatch.setattr(Keys, "pressed", lambda self: next(typed))
    operator = Operator(LIFT)
    assert checklist._live(operator) == 1
    assert operator.called == ["confirm", "repeat", "confirm"]
