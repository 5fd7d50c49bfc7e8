"""Result of a check: a verdict, one line with the finding, one line with advice."""

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """OK; WARN: flights work, something is missing or slower; FAIL: something will not work."""

    OK = "OK"
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True)
class Finding:
    """Result of one check; `advice` is empty if no action is needed."""

    check: str
    verdict: Verdict
    found: str
    advice: str = ""


def ok(check: str, found: str) -> Finding:
    return Finding(check, Verdict.OK, one_line(found))


def warn(check: str, found: str, advice: str) -> Finding:
    """Return a finding with a problem that does not prevent flights."""
    return Finding(check, Verdict.WARN, one_line(found), one_line(advice))


def fail(check: str, found: str, advice: str) -> Finding:
    """Return a finding with a problem that prevents some function."""
    return Finding(check, Verdict.FAIL, one_line(found), one_line(advice))


def one_line(text: str) -> str:
    """Return the text without line breaks, which messages of libraries may have."""
    return " ".join(text.split())
