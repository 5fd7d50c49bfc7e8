"""The criteria of a design: config/design/criteria.yaml, single entries replaced by a file."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section

SHIPPED = "design/criteria.yaml"


class DesignError(ValueError):
    """Criteria that are not valid, or a vehicle that cannot be designed; one-line message."""


def load_criteria(own: str | Path | None = None) -> SimpleNamespace:
    """Return the criteria by section and name, as `criteria.rate.damping`.

    own: a file whose entries replace the shipped ones. Raises DesignError.
    """
    shipped = read_section(configuration.path(SHIPPED), DesignError)
    given = Section({}, "", DesignError) if own is None else read_section(Path(own), DesignError)
    return _merged(shipped, given)


def _merged(shipped: Section, given: Section) -> SimpleNamespace:
    given.only(shipped.values)
    found: dict[str, Any] = {}
    for name, value in shipped.values.items():
        if isinstance(value, dict):
            inner = given.section(name) if given.has(name) else Section({}, "", DesignError)
            found[name] = _merged(shipped.section(name), inner)
            continue
        of = given if given.has(name) else shipped
        found[name] = of.numbers(name, len(value)) if isinstance(value, list) else of.positive(name)
    return SimpleNamespace(**found)
