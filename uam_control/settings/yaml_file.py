"""YAML files: numbers as ROS reads them, and what is wrong with a file in one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml


class _Loader(yaml.SafeLoader):
    """Reads 1e-4 as the number that it is to ROS; YAML 1.1 wants 1.0e-4."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?[0-9][0-9_]*(\.[0-9_]*)?[eE][-+]?[0-9]+$"),
    list("-+0123456789"),
)


def read(file: Path, error: type[ValueError]) -> Any:
    """What the file holds; raises `error` with one line: file, place, what is wrong."""
    try:
        return yaml.load(file.read_text(), _Loader)  # noqa: S506 (a SafeLoader)
    except OSError as reason:
        raise error(f"{file}: {reason.strerror or reason}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as reason:
        mark = getattr(reason, "problem_mark", None)
        where = f" line {mark.line + 1} column {mark.column + 1}" if mark else ""
        raise error(f"{file}{where}: not valid YAML") from None
