"""Writes the table of topics in docs/interfaces.md from the code: python docs/make_interfaces.py"""

from __future__ import annotations

from pathlib import Path

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.interface import CONTENTS, Content
from uam_msgs_py.messages.serialized import type_name
from uam_msgs_py.node.wiring import WIRES, Wire

PAGE = Path(__file__).with_name("interfaces.md")
BEGIN, END = "<!-- made by docs/make_interfaces.py -->\n", "<!-- end -->\n"
HEAD = ("topic", "type", "QoS", "frame", "unit", "rate", "publisher", "who needs it")


def table() -> str:
    """Return the table of all topics in Markdown, in the order of `topics`."""
    wires = {wire.topic: wire for wire in WIRES}
    rows = [_row(topic, CONTENTS[topic], wires.get(topic)) for topic in topics.ALL]
    lines = [HEAD, ("---",) * len(HEAD), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def page(text: str) -> str:
    """Return the page `text` with the present table."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


def _row(topic: topics.Topic, content: Content, wire: Wire | None) -> tuple[str, ...]:
    publisher, readers = content.publisher, content.readers
    if wire is not None:
        publisher = wire.publisher
        readers = ", ".join(wire.subscribers) or "recorder"
        readers += " (optional)" if wire.optional else ""
    return (
        f"`/{topic.name.removeprefix('/')}`",
        type_name(topic.type).replace("/msg/", "/"),
        _qos(topic),
        content.frame,
        content.unit,
        content.rate,
        publisher if topic.one_publisher else f"{publisher} (several allowed)",
        readers,
    )


def _qos(topic: topics.Topic) -> str:
    offered = topic.qos
    latched = ", latched" if offered.durability.name == "TRANSIENT_LOCAL" else ""
    return f"{offered.reliability.name.lower().replace('_', ' ')}{latched}, {offered.depth}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
