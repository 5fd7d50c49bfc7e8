"""What a check has found: a verdict, one line of what is there, one line of what to do."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """OK; WARN: flights work, something is missing or slower; FAIL: something will not work."""

    OK = "OK"
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True)
class Finding:
    """One check's result; `advice` is empty where nothing is to be done."""

    check: str
    verdict: Verdict
    found: str
    advice: str = ""


def ok(check: str, found: str) -> Finding:
    """All is well."""
    return Finding(check, Verdict.OK, one_line(found))


def warn(check: str, found: str, advice: str) -> Finding:
    """Flights work, but not as well as they might."""
    return Finding(check, Verdict.WARN, one_line(found), one_line(advice))


def fail(check: str, found: str, advice: str) -> Finding:
    """Something will not work."""
    return Finding(check, Verdict.FAIL, one_line(found), one_line(advice))


def one_line(text: str) -> str:
    """The text without line breaks, as error messages of others may have them."""
    return " ".join(text.split())
