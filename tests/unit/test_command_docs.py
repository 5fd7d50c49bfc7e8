"""docs/commands.md names every command of `uam`, and its examples parse; options have a help."""

from __future__ import annotations

import argparse
import re
import shlex
from pathlib import Path

import pytest
from pid_law import PidLaw

from uam_control.laws import catalogue
from uam_lab.cli.parser import parser
from uam_lab.experiments.compare import plan

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs/commands.md").read_text()
FOUND = re.findall(r"^## uam ([\w, -]+)\n(.*?)(?=^## )", TEXT, re.M | re.S)
SECTIONS = {name: text for names, text in FOUND for name in names.split(", ")}


def commands() -> dict[str, argparse.ArgumentParser]:
    """Name → parser of every subcommand."""
    (found,) = (a for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
    return found.choices


def words(line: str) -> list[str]:
    """The words of a command, without the redirection of its output."""
    return shlex.split(re.split(r" [>|] ", line)[0])


@pytest.mark.parametrize("name", commands())
def test_the_help_of_a_command_can_be_printed(name):
    assert f"uam {name}" in commands()[name].format_help()


def test_there_is_a_section_for_every_command():
    assert set(SECTIONS) == set(commands())


@pytest.mark.parametrize("name", commands())
def test_every_option_of_a_command_has_its_help(name):
    """The page has no list of options: --help is where they stand."""
    assert all(action.help and action.help.strip() for action in commands()[name]._actions)


@pytest.mark.parametrize("name", commands())
def test_the_examples_of_a_command_parse(name):
    found = re.findall(rf"^(?:\w+=\S+ )?uam ({name}.*?)(?: {{2,}}#.*)?$", SECTIONS[name], re.M)
    assert found
    for line in found:
        parser().parse_args(words(line))


@pytest.mark.parametrize(
    "file", [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))], ids=lambda file: file.name
)
def test_every_command_of_a_code_block_parses(file, monkeypatch):
    """As `uam ...` or `.venv/bin/uam ...`, behind variables of the environment."""
    for table in (catalogue.LAWS, plan.ROWS):  # the law of docs/extending.md, which adds it
        monkeypatch.setitem(table, "pid", PidLaw)
    blocks = re.findall(r"^ *```\w*\n(.*?)^ *```", file.read_text(), re.M | re.S)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    for line in lines:
        found = re.match(
            r"\s*(?:\w+=\S+ )*(?:\.venv/bin/)?uam ([a-z-]+(?: .*?)?)(?:\s+#.*| {2,}.*)?$", line
        )
        if found and found[1].split()[0] in commands():
            parser().parse_args(words(found[1]))
