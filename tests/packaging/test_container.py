"""The Dockerfile does what README.md and the Makefile say, on an image of an allowed Python."""

import json
import re
import tomllib
from pathlib import Path

from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
FILE = (ROOT / "Dockerfile").read_text()
README = (ROOT / "README.md").read_text()
LINES = [line.partition(" ")[::2] for line in FILE.splitlines() if line and line[0] != "#"]


def lines(instruction):
    return [text for name, text in LINES if name == instruction]


def test_the_image_has_a_python_that_the_project_allows():
    (image,) = lines("FROM")
    name, _, tag = image.partition(":")
    assert name == "python"  # a short name: no registry
    assert tag in SpecifierSet(PROJECT["requires-python"])


def test_it_sets_up_and_flies_with_the_commands_of_the_readme():
    targets = re.findall(r"^(\w+):.*##", (ROOT / "Makefile").read_text(), re.M)
    (fly,) = lines("CMD")
    assert json.loads(fly) == ["make", "fly"] and "\nmake fly " in README
    assert lines("RUN")[-1] == "make setup" and {"setup", "fly", "test"} <= set(targets)


def test_it_has_the_renderer_of_the_readme():
    wanted = re.search(r"`apt install ([\w -]+)`", README)[1]
    assert f"apt-get install --yes {wanted} " in lines("RUN")[0]


def test_what_set_up_makes_stays_outside_of_the_image():
    ignored = (ROOT / ".dockerignore").read_text().split("\n")
    assert {".venv", "results"} <= set(ignored)
    assert lines("COPY") == [". ."]
