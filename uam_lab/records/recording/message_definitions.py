"""ROS message definitions as `ros2msg` schemas for MCAP.

A schema is the .msg file of the type followed, for each type it depends on, by a line of 80 `=`,
a line `MSG: package/Name` and that type's .msg file (MCAP specification, appendix "ros2msg").
"""

import importlib.util
import json
import re
from functools import cache
from pathlib import Path

from uam_msgs_py.messages import tf_message

SEPARATOR = "=" * 80
# Field line: type, optional bound and array, name. Constants and comments never name a type.
FIELD = re.compile(r"^\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[(?:<=)?\d*\])?\s+[A-Za-z]\w*")
PRIMITIVES = {
    *("bool", "byte", "char", "float32", "float64", "string", "wstring"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}


class DefinitionMissing(LookupError):
    """The .msg file of a type was not found; the text is one line."""


@cache
def definition(type_name: str) -> str:
    """Return the .msg text of `package/msg/Name`. Raises DefinitionMissing."""
    own = _own(type_name)
    return tf_message.DEFINITION if own else _file(type_name, "msg").read_text(encoding="utf-8")


@cache
def type_hash(type_name: str) -> str:
    """Return the hash of `package/msg/Name` by which ROS compares types, `RIHS01_...`.

    Raises DefinitionMissing.
    """
    if _own(type_name):
        return f"RIHS01_{tf_message.HASH.hex()}"
    hashes = json.loads(_file(type_name, "json").read_text(encoding="utf-8"))["type_hashes"]
    return next(one["hash_string"] for one in hashes if one["type_name"] == type_name)


def _own(type_name: str) -> bool:
    """Return whether the type is the one that this project brings itself."""
    package = type_name.partition("/")[0]
    return package == tf_message.PACKAGE and importlib.util.find_spec(package) is None


def _file(type_name: str, suffix: str) -> Path:
    """Return the file of a type in share/<package>/msg. Raises DefinitionMissing."""
    package, _, name = type_name.partition("/msg/")
    module = importlib.util.find_spec(package)
    if module is None or module.origin is None:
        raise DefinitionMissing(f"message package {package} is not installed")
    # in wheels and apt installations, lib/pythonX.Y/site-packages/<package> and share/<package>
    # have a common parent folder
    for prefix in Path(module.origin).parents:
        file = prefix / "share" / package / "msg" / f"{name}.{suffix}"
        if file.is_file():
            return file
    raise DefinitionMissing(f"no definition of {type_name} above {module.origin}")


def dependencies(type_name: str) -> list[str]:
    """Return the message types of the fields of `package/msg/Name`, in order of appearance."""
    package = type_name.partition("/")[0]
    found: dict[str, None] = {}
    for line in definition(type_name).splitlines():
        field = FIELD.match(line)
        if field is None or field[1] in PRIMITIVES:
            continue
        name = field[1] if "/" in field[1] else f"{package}/{field[1]}"
        found["/msg/".join(name.replace("/msg/", "/").split("/"))] = None
    return list(found)


@cache
def schema(type_name: str) -> str:
    """Return the complete `ros2msg` schema of `package/msg/Name`.

    Raises DefinitionMissing if a required package is not installed.
    """
    parts = [definition(type_name)]
    queue, seen = dependencies(type_name), {type_name}
    while queue:
        name = queue.pop(0)
        if name in seen:
            continue
        seen.add(name)
        parts.append(f"{SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{definition(name)}")
        queue += dependencies(name)
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"
