"""Tells Fast DDS not to connect publishers and subscriptions of the same process.

For nodes that pass messages to each other by `local_delivery`: otherwise the middleware copies each
message once more for every subscription that nobody reads. Without it the process works as well.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

PROFILES_FILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
SPACE = "http://www.eprosima.com"  # of XML names
PROPERTY = "fastdds.ignore_local_endpoints"
EMPTY = (
    f'<dds xmlns="{SPACE}"><profiles><participant profile_name="uam" is_default_profile="true">'
    "<rtps/></participant></profiles></dds>"
)


def with_property(profiles: str) -> str:
    """Return the XML `profiles` with the property in each default profile of a participant.

    Raises ElementTree.ParseError for a text that is no XML.
    """
    ElementTree.register_namespace("", SPACE)
    top = ElementTree.fromstring(profiles)
    for participant in top.iter(f"{{{SPACE}}}participant"):
        rtps = participant.find(f"{{{SPACE}}}rtps")
        if participant.get("is_default_profile") != "true" or rtps is None:
            continue
        policy = _child(rtps, "propertiesPolicy")
        entry = ElementTree.SubElement(_child(policy, "properties"), f"{{{SPACE}}}property")
        ElementTree.SubElement(entry, f"{{{SPACE}}}name").text = PROPERTY
        ElementTree.SubElement(entry, f"{{{SPACE}}}value").text = "true"
    return ElementTree.tostring(top, encoding="unicode")


def _child(parent: ElementTree.Element, name: str) -> ElementTree.Element:
    """Return the child of this name, a new one if there is none."""
    found = parent.find(f"{{{SPACE}}}{name}")
    return ElementTree.SubElement(parent, f"{{{SPACE}}}{name}") if found is None else found


@contextlib.contextmanager
def ignore_own_endpoints() -> Iterator[None]:
    """Set the property for the first participant of this process, made in the `with` block.

    That is: for the first node. The user's file of profiles is kept and the property added, in a
    temporary file. A file that cannot be read is left to the middleware, which reports it.
    """
    before = os.environ.get(PROFILES_FILE)
    try:
        text = with_property(Path(before).read_text(encoding="utf-8") if before else EMPTY)
    except (OSError, ElementTree.ParseError):
        yield
        return
    with tempfile.NamedTemporaryFile("w", prefix="uam-profiles-", suffix=".xml") as file:
        file.write(text)
        file.flush()
        os.environ[PROFILES_FILE] = file.name
        try:
            yield
        finally:
            os.environ.pop(PROFILES_FILE)
            if before is not None:
                os.environ[PROFILES_FILE] = before
