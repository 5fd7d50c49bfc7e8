"""Names and messages of others are shown as they are: no markup, no escape codes, no formulas."""

import io
import re
from pathlib import Path

import pytest
from rich.table import Table

import uam_lab
from uam_control.settings.texts import visible
from uam_lab.records.results.templates import markdown_table
from uam_lab.records.results.terminal import Terminal, say
from uam_lab.report.figures import style
from uam_lab.report.page.console import reporting

HOSTILE = ("[mm]", "[/x]", "[red]x[/red]", ":smile:", "[link=http://a]b[/link]")


def shown(*things, terminal: bool = False) -> str:
    out = io.StringIO()
    Terminal(file=out, width=200, force_terminal=terminal).print(*things)
    return out.getvalue()


@pytest.mark.parametrize("text", HOSTILE)
def test_brackets_stay_in_lines_tables_and_titles(text):
    table = Table(text, title=text)
    table.add_row(text)
    assert text in shown(text)
    assert shown(table).count(text) == 3


def test_brackets_stay_in_the_progress_of_a_report():
    out = io.StringIO()
    with reporting(Terminal(file=out, force_terminal=True, width=80)) as progress:
        progress("figure [/x] [mm]")
    assert "figure [/x] [mm]" in out.getvalue()


def test_escape_codes_and_newlines_become_visible(capsys):
    assert visible("a\x1b[2Jb\nc\rd\x9be\u202ef") == "a␛[2Jb␊c␍d�e�f"
    say("a\x1b]0;t\x07\nb")
    assert capsys.readouterr().out == "a␛]0;t␇\nb\n"
    table = Table("a\x1b[31m")
    table.add_row("b\x1b[2J")
    assert "\x1b" not in shown(table, "c\x1b[1m")
    assert "b␛[2J" in shown(table)
    assert "\x1b[2J" not in shown(table, terminal=True)


def test_everything_that_the_commands_print_goes_through_one_door():
    print_or_console = re.compile(r"(?<![\w.])print\(|(?<!\w)Console\(")
    found = [
        f"{file.name}: {line.strip()}"
        for file in (Path(uam_lab.__path__[0]) / "cli").glob("*.py")
        for line in file.read_text().splitlines()
        if print_or_console.search(line)
    ]
    # the one of main comes before anything is imported
    assert found == ['main.py: print("uam: interrupted", file=sys.stderr, flush=True)']


def test_a_pipe_in_a_name_makes_no_cell():
    table = markdown_table(["a|b"], [["c|d\ne"]])
    assert table == "| a\\|b |\n|---|\n| c\\|d␊e |"


@pytest.mark.parametrize("name", ["$", "$x$", "a$\\frac$b", "$\\nothing$", "x_1 $^$ y"])
def test_a_dollar_in_a_name_is_no_formula(tmp_path, name):
    from matplotlib.figure import Figure

    with style.styled():
        figure = Figure()
        axis = figure.add_subplot()
        style.title(figure, name)
        style.note(axis, name, (0.0, 0.5), (0, 0))
        axis.set_title(name)
        axis.legend(handles=[style.key(name, "black")])
        axis.set_ylabel("$V_p$", parse_math=True)
        style.save(figure, tmp_path / "figure.svg")
    assert (tmp_path / "figure.svg").exists()
