"""docs/interfaces.md is made from the code; its frames picture can be drawn."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.interface import CONTENTS
from uam_msgs_py.node.wiring import WIRES

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


def test_every_topic_has_its_content_and_a_publisher():
    assert set(CONTENTS) == set(topics.ALL)
    wired = {wire.topic for wire in WIRES}
    for topic, content in CONTENTS.items():
        assert content.unit and content.rate, topic.name
        assert bool(content.publisher and content.readers) != (topic in wired), topic.name


def test_the_picture_of_the_frames_is_drawn(tmp_path):
    script("draw_frames").draw(tmp_path / "frames.png")
    assert (tmp_path / "frames.png").stat().st_size > 10_000
