"""The comparison of rate steps compiles before it flies."""

import sys

import rate_steps
from px4_steps.hover_flight import NotFlown


def test_the_control_path_is_compiled_before_the_steps_are_flown(tmp_path, monkeypatch, capsys):
    done = []

    def measure(autopilot):
        done.append("measured")
        raise NotFlown("not today")

    monkeypatch.setattr(rate_steps.Px4Installation, "find", lambda directory: None)
    monkeypatch.setattr(rate_steps, "prepare", lambda say: done.append("prepared"))
    monkeypatch.setattr(rate_steps, "measure", measure)
    monkeypatch.setattr(sys, "argv", ["rate_steps.py", "--out", str(tmp_path)])
    assert rate_steps.main() == 2 and done == ["prepared", "measured"]
    assert capsys.readouterr().err == "rate_steps: not today\n"
