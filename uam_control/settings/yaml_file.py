"""Reader of YAML files: numbers as in ROS, and one-line errors."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

_SafeLoader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, if PyYAML has it


class _Loader(yaml.SafeLoader):
    """Loader that reads 1e-4 as a number, as ROS does; YAML 1.1 requires 1.0e-4."""


class _FastLoader(_SafeLoader):
    """The same in a tenth of the time; the places of its errors are less exact."""


for _loader in (_Loader, _FastLoader):
    _loader.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"^[-+]?[0-9][0-9_]*(\.[0-9_]*)?[eE][-+]?[0-9]+$"),
        list("-+0123456789"),
    )


def parsed(text: str) -> Any:
    """Return the content of a text. Raises yaml.YAMLError."""
    return yaml.load(text, _FastLoader)  # noqa: S506 (a SafeLoader)


def read(file: Path, error: type[ValueError]) -> Any:
    """Return the content of the file; raise `error` with one line: file, place, error."""
    try:
        text = file.read_text()
        try:
            return parsed(text)
        except yaml.YAMLError:
            return yaml.load(text, _Loader)  # noqa: S506 (a SafeLoader)
    except OSError as reason:
        raise error(f"{file}: {reason.strerror or reason}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as reason:
        mark = getattr(reason, "problem_mark", None)
        where = f" line {mark.line + 1} column {mark.column + 1}" if mark else ""
        raise error(f"{file}{where}: not valid YAML") from None
