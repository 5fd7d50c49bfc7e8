"""Writes the table of topics in docs/interfaces.md from the code: python docs/make_interfaces.py"""

from __future__ import annotations

from pathlib import Path

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.serialized import type_name

PAGE = Path(__file__).with_name("interfaces.md")
BEGIN, END = "<!-- made by docs/make_interfaces.py -->\n", "<!-- end -->\n"
HEAD = ("topic", "type", "QoS", "frame: unit", "rate", "publisher", "who needs it")
USUAL = {"latched": 1}  # depths that are not written; else 32


def table() -> str:
    """Return the table of all topics in Markdown, in the order of `topics`."""
    head, *rows = (f"| {' | '.join(line)} |\n" for line in (HEAD, *map(_row, topics.ALL)))
    return f"{head}|{'---|' * len(HEAD)}\n{''.join(rows)}"


def page(text: str) -> str:
    """Return the page `text` with the present table."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


def _row(topic: topics.Topic) -> tuple[str, ...]:
    readers = topic.readers
    if topic.to is not None:
        readers = (", ".join(topic.to) or "recorder") + topic.optional * " (optional)"
    return (
        f"`/{topic.name.removeprefix('/')}`",
        type_name(topic.type).replace("/msg/", "/"),
        _qos(topic),
        f"{topic.frame}: {topic.unit}" if topic.frame else topic.unit,
        topic.rate,
        topic.publisher + (not topic.one_publisher) * " +",
        readers,
    )


def _qos(topic: topics.Topic) -> str:
    offered = topic.qos
    kind = "latched" if offered.durability.name == "TRANSIENT_LOCAL" else ""
    kind = kind or "best effort" * (offered.reliability.name == "BEST_EFFORT")
    depth = "" if offered.depth == USUAL.get(kind, 32) else str(offered.depth)
    return ", ".join(filter(None, (kind, depth)))


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
