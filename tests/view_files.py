"""What the files in config/views refer to: topics, fields, frames."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import yaml

VIEWS = Path(__file__).resolve().parents[1] / "config/views"
STEP = re.compile(r"\.(\w+)|\[(\d+)\]")


def foxglove() -> tuple[set[str], set[str], set[str]]:
    """Topics shown, fields plotted as "/topic.field[0].field", and frames, of the layout."""
    panels = json.loads((VIEWS / "foxglove.json").read_text())["configById"]
    topics, fields, frames = set(), set(), set()
    for panel in panels.values():
        topics |= set(panel.get("topics", ()))
        topics |= {panel["topicToRender"]} if "topicToRender" in panel else set()
        fields |= {path["value"] for path in panel.get("paths", ())}
        frames |= {name.removeprefix("frame:") for name in panel.get("transforms", ())}
        frames |= {panel["followTf"]} if "followTf" in panel else set()
        frames |= {layer["frameId"] for layer in panel.get("layers", {}).values()}
    return topics, fields, frames


def foxglove_panels() -> tuple[set[str], set[str]]:
    """Panels configured, and panels laid out."""
    layout = json.loads((VIEWS / "foxglove.json").read_text())
    placed = set(_leaves(layout["layout"]))
    for panel in layout["configById"].values():
        for tab in panel.get("tabs", ()):
            placed |= set(_leaves(tab["layout"]))
    return set(layout["configById"]), placed


def _leaves(node) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from _leaves(node["first"])
        yield from _leaves(node["second"])


def plotjuggler() -> set[str]:
    """The curves of the layout."""
    root = ElementTree.parse(VIEWS / "plotjuggler.xml").getroot()
    return {curve.get("name") for curve in root.iter("curve")}


def rviz() -> tuple[dict[str, str], set[str], set[str]]:
    """Topics with the required durability, frames, and marker namespaces of the configuration."""
    manager = yaml.safe_load((VIEWS / "flight.rviz").read_text())["Visualization Manager"]
    topics, frames, namespaces = {}, {manager["Global Options"]["Fixed Frame"]}, set()
    for display in manager["Displays"]:
        for key in ("Topic", "Description Topic"):
            if key in display:
                topics[display[key]["Value"]] = display[key]["Durability Policy"]
        if "Reference Frame" in display:
            frames.add(display["Reference Frame"])
        namespaces |= set(display.get("Namespaces", ()))
    return topics, frames, namespaces


def value_at(message, path: str):
    """What a Foxglove path finds in a decoded message; None where a list is too short.

    Raises AttributeError for a field that the type does not have.
    """
    for name, index in STEP.findall(path):
        if name:
            message = getattr(message, name)
        elif int(index) < len(message):
            message = message[int(index)]
        else:
            return None
    return message


def curves(topic: str, kind: str, message) -> set[str]:
    """The names that PlotJuggler gives to the numbers of a decoded message."""
    if kind == "sensor_msgs/msg/JointState":
        rows = ("position", "velocity", "effort")
        return {f"{topic}/{name}/{row}" for name in message.name for row in rows}
    return set(_flat(topic, message))


def _flat(name: str, value) -> Iterator[str]:
    if isinstance(value, int | float):
        yield name
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            yield from _flat(f"{name}[{i}]", item)
    elif hasattr(value, "__slots__"):
        for field in value.__slots__:
            yield from _flat(f"{name}/{field}", getattr(value, field))
