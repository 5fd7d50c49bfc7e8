"""Run all groups of checks in order; overall verdict and JSON."""

import json
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module

from uam_lab.flights.vehicle.lab_file import Lab
from uam_lab.preflight.doctor.finding import Finding, Verdict, fail

# in the order of the report; each module has checks()
GROUPS = ("installation", "ros", "instances", "rendering", "autopilot", "machine", "leftovers")


def examine(url: str = "", lab: Lab | None = None) -> Iterator[tuple[str, Finding]]:
    """Yield every finding with its group at once.

    url: link of an autopilot, if any; lab: whose devices are checked, if given.
    """
    arguments: dict[str, tuple[object, ...]] = {"autopilot": (url,), "devices": (lab,)}
    for group in GROUPS if lab is None else (*GROUPS, "devices"):
        for finding in _guarded(group, arguments.get(group, ())):
            yield group, finding


def _guarded(group: str, arguments: tuple[object, ...]) -> Iterator[Finding]:
    """Yield the findings of a group; an unexpected error is also a finding."""
    try:
        checks: Callable[..., Iterable[Finding]]
        checks = import_module(f"uam_lab.preflight.doctor.{group}").checks
        yield from checks(*arguments)
    except Exception as error:  # a broken installation may raise anything
        text = f"{type(error).__name__}: {error}"
        yield fail(group, text, "make setup; if the error stays, report it")


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst of the verdicts, OK without any."""
    order = list(Verdict)
    return max(verdicts, key=order.index, default=Verdict.OK)


def as_json(found: Iterable[tuple[str, Finding]]) -> str:
    """Return all findings as one JSON document."""
    found = list(found)
    rows = [
        {
            "group": group,
            "check": finding.check,
            "verdict": finding.verdict.value,
            "found": finding.found,
            "advice": finding.advice,
        }
        for group, finding in found
    ]
    verdict = worst(finding.verdict for _, finding in found)
    return json.dumps({"verdict": verdict.value, "findings": rows}, indent=2)
