"""One line of advice for each reason why PX4 v1.16 refuses to arm or to fly OFFBOARD.

The patterns match the texts of STATUSTEXT ("Preflight Fail: ...") and of events, the results of
COMMAND_ACK as worded by `OffboardSequence`, and mode changes that PX4 made by itself. They are in
config/px4/advice.yaml; the first matching pattern counts.
"""

from __future__ import annotations

import re

from uam_control.settings import configuration, yaml_file

SEPARATOR = " → "

# pattern → what to do
ADVICE: dict[str, str] = yaml_file.read(
    configuration.path("px4/advice.yaml"), configuration.ConfigurationError
)

_COMPILED = tuple((re.compile(pattern, re.IGNORECASE), what) for pattern, what in ADVICE.items())


_PASSING, _BEFORE_THE_STREAM = (
    re.compile("|".join(patterns), re.IGNORECASE)
    for patterns in (
        yaml_file.read(configuration.path("px4/passing.yaml"), configuration.ConfigurationError)
    ).values()
)


def passing(text: str, streaming: bool) -> bool:
    """Return whether `text` also comes in a normal start or landing (config/px4/passing.yaml).

    streaming: whether setpoints have been streamed long enough.
    """
    if not streaming and _BEFORE_THE_STREAM.search(text):
        return True
    return _PASSING.search(text) is not None


def advice(text: str) -> str | None:
    """Return the advice for `text`; None if no pattern matches."""
    for pattern, what in _COMPILED:
        if pattern.search(text):
            return what
    return None


def with_advice(text: str) -> str:
    """Return `text` followed by its advice; unchanged if it has advice already."""
    what = None if SEPARATOR in text else advice(text)
    return text if what is None else f"{text}{SEPARATOR}{what}"
