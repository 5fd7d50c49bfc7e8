"""Reader of YAML files: numbers as in ROS, every key once, and one-line errors."""

import re
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, TypeVar

import yaml

from uam_control.settings.texts import text_of

_SafeLoader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, if PyYAML has it
T = TypeVar("T")
OCTAL = re.compile(r"[-+]?0[0-9_]+$")
MERGE = "tag:yaml.org,2002:merge"  # of the key <<
# of constructors: 2024-13-01, !!int x, a list in itself, a text that is no sequence ...
_REFUSALS = (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError, RecursionError)


class _KeyTwice(yaml.constructor.ConstructorError):
    """A key that the same mapping has already."""


class _NotPlain(yaml.constructor.ConstructorError):
    """A number that YAML 1.1 reads as another one than a person does, or that has no float."""


class _Strict:
    """Part of a loader: refuses a key given twice, of which YAML's readers keep the last, and
    numbers like 1:30 (90) and 010 (8)."""

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """Return a decimal or hexadecimal whole number of 64 bits, as ROS has them."""
        return self._plain(node, super().construct_yaml_int)

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float:
        """Return a number that is not written as minutes and seconds."""
        return self._plain(node, super().construct_yaml_float)

    def _plain(self, node: yaml.ScalarNode, construct: Callable[[yaml.ScalarNode], T]) -> T:
        if ":" in node.value or OCTAL.match(node.value):
            text = f"{node.value}: a decimal number expected, or a text in quotes"
            raise _NotPlain(problem=text, problem_mark=node.start_mark)
        number = construct(node)
        if isinstance(number, int) and not -(2**63) <= number < 2**64:
            text = "a whole number of at most 64 bits expected"
            raise _NotPlain(problem=text, problem_mark=node.start_mark)
        return number

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
    for _kind in ("int", "float"):
        _construct = getattr(_loader, f"construct_yaml_{_kind}")
        _loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _construct)


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
        said = reason.problem if isinstance(reason, _KeyTwice | _NotPlain) else "not valid YAML"
        raise error(f"{file}{where}: {said}") from None
