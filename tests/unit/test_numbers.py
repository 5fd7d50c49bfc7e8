"""`make numbers`: marks of the documentation, numbers that moved, tables without a mark."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import numbers_of_docs as numbers

PAGE = """# Page
<!-- numbers: uam margins; 2 %; short -->
| loop | delay ms |
|---|---|
| x | 100.0 |
| y | 50.0 |

## Next
| loop | delay |
|---|---|
| z | 3.0 |
"""
OUTPUT = "said\n| loop | delay ms |\n|---|---|\n| x | 101.9 |\n| y | 52.0 |\n"


@pytest.fixture
def page(tmp_path):
    file = tmp_path / "page.md"
    file.write_text(PAGE)
    return file


def test_a_mark_names_command_tolerance_and_when(page):
    (mark,) = numbers.marks(page)
    assert (mark.command, mark.tolerance, mark.when) == ("uam margins", 0.02, "short")
    assert numbers.unmarked(page) == [9]


def test_what_moved_beyond_the_tolerance_is_named(page):
    (mark,) = numbers.marks(page)
    (one,) = numbers.compare(mark, OUTPUT)  # x by 1.9 %, y by 4 %
    assert (one.line, one.old, one.new) == (6, "50.0", "52.0")


def test_a_line_that_the_command_does_not_print_is_named(page):
    (mark,) = numbers.marks(page)
    found = numbers.compare(mark, OUTPUT.replace("| y |", "| w |"))
    assert [(one.line, one.new) for one in found] == [(6, "not in the output")]


def test_an_update_writes_the_commands_table(page):
    (mark,) = numbers.marks(page)
    output = OUTPUT + "| w | 1.0 |\n"
    numbers.update(mark, output)
    (mark,) = numbers.marks(page)
    assert numbers.compare(mark, output) == []
    text = page.read_text()
    assert "| x | 101.9 |\n| y | 52.0 |\n| w | 1.0 |\n\n## Next" in text
    assert "| z | 3.0 |" in text


def test_the_last_digit_may_move_by_one():
    assert numbers.moved("| 0.05 | 7 |", "| 0.06 | 7 |", 0.01) == []
    assert numbers.moved("| 0.05 | 7 |", "| 0.05 | 8 |", 0.01) == [("7", "8")]


def test_every_table_of_the_documentation_with_measured_numbers_has_a_mark():
    bare = {page.name: numbers.unmarked(page) for page in (numbers.ROOT / "docs").glob("*.md")}
    assert not {name: lines for name, lines in bare.items() if lines}
