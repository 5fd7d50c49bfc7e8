"""Reader of YAML files: numbers as in ROS, every key once, and one-line errors."""

from __future__ import annotations

import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from uam_control.settings.text_file import text_of

_SafeLoader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, if PyYAML has it
MERGE = "tag:yaml.org,2002:merge"  # of the key <<
# of constructors: 2024-13-01, !!int x, a list in itself, a text that is no sequence ...
_REFUSALS = (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError, RecursionError)


class _KeyTwice(yaml.constructor.ConstructorError):
    """A key that the same mapping has already."""


class _Strict:
    """Part of a loader: refuses a key given twice, of which YAML's readers keep the last."""

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Check the keys before those of `<<` are put among them: those may be given again."""
        lines: dict[Hashable, int] = {}
        for key_node, _ in [] if hasattr(node, "flat") else node.value:
            key = None if key_node.tag == MERGE else self.construct_object(key_node, deep=True)
            if key is None or not isinstance(key, Hashable):  # of which the reader itself speaks
                continue
            line = key_node.start_mark.line + 1
            if key in lines:
                raise _KeyTwice(
                    problem=f"'{key}' is given twice, in lines {lines[key]} and {line}",
                    problem_mark=key_node.start_mark,
                )
            lines[key] = line
        node.flat = True
        super().flatten_mapping(node)


class _Loader(_Strict, yaml.SafeLoader):
    """Loader that reads 1e-4 as a number, as ROS does; YAML 1.1 requires 1.0e-4."""


class _FastLoader(_Strict, _SafeLoader):
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
    text = text_of(file, error)
    try:
        try:
            return parsed(text)
        except yaml.YAMLError:
            return yaml.load(text, _Loader)  # noqa: S506 (a SafeLoader)
    except _REFUSALS as reason:
        mark = getattr(reason, "problem_mark", None)
        where = f" line {mark.line + 1} column {mark.column + 1}" if mark else ""
        said = reason.problem if isinstance(reason, _KeyTwice) else "not valid YAML"
        raise error(f"{file}{where}: {said}") from None
