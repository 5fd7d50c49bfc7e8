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


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("a: 1\nb: 2\na: 3\n", "line 3 column 1: 'a' is given twice, in lines 1 and 3"),
        ("a:\n  b: [{c: 1,\n    c: 1}]\n", "line 3 column 5: 'c' is given twice, in lines 2 and 3"),
        ("1: a\n0x1: b\n", "line 2 column 1: '1' is given twice"),
        ("on: a\nyes: b\n", "line 2 column 1: 'True' is given twice"),
        ("base: &b {x: 1, x: 2}\nc: {<<: *b}\n", "line 1 column 17: 'x' is given twice"),
    ],
)
def test_a_key_given_twice_is_refused_with_both_lines(tmp_path, text, place):
    file = tmp_path / "made.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=f"made.yaml {place}"):
        yaml_file.read(file, ValueError)


def test_a_merge_gives_a_key_again(tmp_path):
    file = tmp_path / "made.yaml"
    file.write_text("base: &b {x: 1, y: 2}\nc: {<<: *b, x: 3}\nd: {<<: [*b, {z: 4}]}\n")
    assert yaml_file.read(file, ValueError)["c"] == {"x": 3, "y": 2}


@pytest.mark.parametrize("number", ["1:30", "010", "-1:30.5", "0_7", "1" + "0" * 400])
def test_a_number_that_yaml_reads_as_another_one_is_refused(tmp_path, number):
    file = tmp_path / "made.yaml"
    file.write_text(f"a:\n  b: [1, {number}]\n")
    with pytest.raises(ValueError, match="made.yaml line 2 column .* expected"):
        yaml_file.read(file, ValueError)
    file.write_text(f"a: '{number}'\nb: [0, 0.5, 00.5, 0x0c, -7, 1_000]\n")
    assert yaml_file.read(file, ValueError) == {"a": number, "b": [0, 0.5, 0.5, 12, -7, 1000]}


@pytest.mark.parametrize(
    "content",
    [
        b"a: 2024-13-45",
        b"!!int x",
        b"a: !!timestamp x",
        b"a: 0b_",
        b"a: \x00",
        b"\xff",
    ],
)
def test_every_other_content_is_one_line(tmp_path, content):
    class Refused(ValueError):
        pass

    file = tmp_path / "made.yaml"
    file.write_bytes(content)
    with pytest.raises(Refused, match="made.yaml.*: not (valid YAML|a text in UTF-8)"):
        yaml_file.read(file, Refused)


def test_a_byte_order_mark_is_no_part_of_a_key(tmp_path):
    file = tmp_path / "made.yaml"
    file.write_text("a: ö\n", encoding="utf-8-sig")
    assert yaml_file.read(file, ValueError) == {"a": "ö"}
