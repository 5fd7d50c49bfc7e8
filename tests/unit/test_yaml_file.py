"""Reading of YAML files: the fast reader and the exact one agree, and errors name their place."""

from pathlib import Path

import pytest
import yaml

from uam_control.settings import configuration, yaml_file

FILES = sorted(configuration.root().rglob("*.yaml"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.name}")
def test_both_readers_give_the_same(file):
    exact = yaml.load(file.read_text(), yaml_file._Loader)  # noqa: S506 (a SafeLoader)
    assert repr(yaml_file.read(file, ValueError)) == repr(exact)


@pytest.mark.parametrize(
    ("text", "place"),
    [("moves: [", "line 1 column 9"), ("a: 1\nb: {c: 2\n", "line 3 column 1"), ("a: @", "line 1")],
)
def test_an_error_names_its_place(tmp_path, text, place):
    file = tmp_path / "made.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=f"made.yaml {place}.*: not valid YAML"):
        yaml_file.read(file, ValueError)


def test_numbers_are_read_as_ros_reads_them(tmp_path):
    file = Path(tmp_path / "made.yaml")
    file.write_text("a: 1e-4\nb: -2E+3\nc: 1_0e1\nd: e5\n")
    assert yaml_file.read(file, ValueError) == {"a": 1e-4, "b": -2000.0, "c": 100.0, "d": "e5"}
