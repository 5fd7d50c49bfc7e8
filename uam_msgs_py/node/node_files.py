"""The files that a node writes beside its log."""

import json
from pathlib import Path

from rclpy.node import Node

from uam_control.settings.atomic import write_text


def write_json(node: Node, file: str, content: object) -> None:
    """Write `content` to `file`, "" for none; log what cannot be written."""
    if not file:
        return
    try:
        write_text(Path(file), json.dumps(content, indent=1) + "\n")
    except OSError as error:
        node.get_logger().error(f"{file} cannot be written: {error.strerror}")
