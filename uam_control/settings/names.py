"""What is said of a name that is not one of those allowed."""

from collections.abc import Collection
from difflib import get_close_matches

SHORT = 12  # names of a list that is always shown


def unknown(name: object, allowed: Collection[str]) -> str:
    """Return "unknown", the nearest of the `allowed` names if one is near, and a list of all.

    With a near name a long list is left out.
    """
    near = get_close_matches(str(name), allowed, 1)
    meant = f", did you mean {near[0]}?" if near else ";"
    listed = f" allowed: {', '.join(allowed) or 'nothing'}"
    return f"unknown{meant}" + ("" if near and len(allowed) > SHORT else listed)
