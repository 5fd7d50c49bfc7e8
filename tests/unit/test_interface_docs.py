"""docs/interfaces.md is made from the code; its frames picture can be drawn."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from uam_msgs_py.messages import topics

ROOT = Path(__file__).resolve().parents[2]


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f"docs/{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_has_the_table_of_the_code():
    made = script("make_interfaces")
    text = made.PAGE.read_text()
    assert text == made.page(text), "run: python docs/make_interfaces.py"


def test_every_topic_says_what_it_carries_and_who_needs_it():
    for topic in topics.ALL:
        assert topic.unit and topic.rate and topic.publisher and topic.about, topic.name
        assert bool(topic.readers) != (topic.to is not None), topic.name


def test_the_picture_of_the_frames_is_drawn(tmp_path):
    script("draw_frames").draw(tmp_path / "frames.png")
    assert (tmp_path / "frames.png").stat().st_size > 10_000
