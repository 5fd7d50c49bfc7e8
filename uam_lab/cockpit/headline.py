"""The headline of the page: state of the vehicle, phase, tracking errors; and the checklist."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import viser
from std_srvs.srv import Trigger

from uam_control.supervision import PreflightCheck
from uam_lab.cockpit.commands import Later, Said
from uam_lab.cockpit.services import Services
from uam_lab.cockpit.vehicle_health import BAD, CAUTION, GOOD, UNKNOWN, Health, grade
from uam_lab.records.results import templates
from uam_msgs_py.messages.checklist import read_checks
from uam_msgs_py.messages.status import AutopilotState, ChecklistState

COLOURS = {GOOD: "#1b8a5a", CAUTION: "#c77700", BAD: "#c62828", UNKNOWN: "#777777"}
MARKS = {GOOD: "●", CAUTION: "▲", BAD: "■", UNKNOWN: "○"}
WARY = 0.7  # share of a limit from which on a delay is shown as a caution
SHOWN = 4  # largest number of listed nodes with problems
# title, name of the limits, factor to the unit
ERRORS = (
    ("position", "position_error", 100.0, "cm"),
    ("attitude", "attitude_error", math.degrees(1.0), "°"),
    ("arm", "arm_error", math.degrees(1.0), "°"),
)
Row = tuple[str, str, str]  # name, level, text
LEVELS = {True: GOOD, False: BAD, None: UNKNOWN}
TOP = -1.0  # place on the panel: above the headline
ACTIONS = (("Confirm", "confirm", "CHECK"), ("Repeat the step", "repeat", "REPEAT"))


def headline(health: Health, limits: Mapping[str, list[float]]) -> str:
    """Return the HTML; limits: pairs (caution, bad) of config/views/cockpit.yaml by name."""
    (level, words, why), mission = health.state(), health.mission
    time = f"T {mission.time:+.1f} s" if mission is not None and mission.time >= 0.0 else ""
    return templates.render(
        "uam_lab.cockpit",
        "headline.html.j2",
        colours=COLOURS,
        marks=MARKS,
        level=level,
        words=words,
        below=[text for text in (why, time) if text],
        errors=list(_errors(health, limits)),
        facts=list(_facts(health, limits)),
        nodes=_nodes(health),
        preflight=_preflight(health),
    )


def _errors(
    health: Health, limits: Mapping[str, list[float]]
) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield title, level, value, unit, and value / limit [%] of each error."""
    for (title, name, factor, unit), value in zip(ERRORS, health.errors, strict=True):
        known = math.isfinite(value)
        text = f"{factor * value:.1f}" if known else "–"
        share = min(1.0, value / limits[name][1]) if known else 0.0
        yield title, grade(value, *limits[name]), text, unit, f"{100.0 * share:.0f}"


def _facts(health: Health, limits: Mapping[str, list[float]]) -> Iterator[Row]:
    autopilot, mission = health.autopilot, health.mission
    level = GOOD if autopilot is not None and autopilot.connected else CAUTION
    yield "autopilot", level, "no message" if autopilot is None else autopilot.summary
    if autopilot is not None and autopilot.reasons:
        yield "", CAUTION, autopilot.reasons
    if autopilot is not None:
        yield "control", *_control(autopilot)
    if mission is not None:
        yield "tilt", GOOD, f"{math.degrees(mission.tilt):.1f}°"
    yield from _delays(health)
    if math.isfinite(health.battery):
        yield "battery", grade(health.battery, *limits["battery"]), f"{health.battery:.0%}"
    yield "magnet", GOOD, "on" if mission is not None and mission.magnet else "off"
    if health.frozen:
        yield "adaptation", CAUTION, "frozen: " + ", ".join(sorted(health.frozen))
    if health.saturated:
        yield "saturated", CAUTION, ", ".join(sorted(health.saturated))
    if health.refused:
        yield "page", CAUTION, f"{health.refused} messages refused, see the log"
    if health.sparing:
        yield "page", CAUTION, "the processor is busy: fewer frames, no charts of each tick"
    if health.real_time_factor:
        yield "speed", GOOD, f"{health.real_time_factor} × real time"


def _control(autopilot: AutopilotState) -> tuple[str, str]:
    if autopilot.released_to:
        return BAD, f"{autopilot.released_to}, has control"
    return GOOD, "companion" if autopilot.armed else "nobody: disarmed"


def _delays(health: Health) -> Iterator[Row]:
    """Yield the measured delays of the loop, with their limits."""
    autopilot, mission = health.autopilot, health.mission
    latency, period = health.latency, health.period
    if mission is not None and mission.setpoint_delay is not None and mission.delay_margin:
        late, margin = mission.setpoint_delay, mission.delay_margin
        level = grade(late, *(share * margin for share in health.delay_shares))
        yield "setpoint delay", level, f"{1e3 * late:.1f} of {1e3 * margin:.0f} ms margin"
    if autopilot is not None and autopilot.round_trip is not None:
        yield "link", GOOD, f"{1e3 * autopilot.round_trip:.1f} ms there and back"
    if math.isfinite(latency) and math.isfinite(period):
        level = grade(latency, WARY * period, period)
        yield "computing", level, f"{1e3 * latency:.1f} of {1e3 * period:.0f} ms per tick"


def _preflight(health: Health) -> list[Row]:
    """Return the pre-arm report while the vehicle is on the ground."""
    mission = health.mission
    if mission is None or not (mission.time < 0.0 or mission.done):
        return []
    return [
        (check.name, GOOD if check.passed else BAD, f"{check.value} ({check.limit})")
        for check in health.preflight
    ]


def _nodes(health: Health) -> list[Row]:
    problems = health.ailing()
    if not health.nodes:
        return [("nodes", UNKNOWN, "no message")]
    if not problems:
        return [("nodes", GOOD, f"all {len(health.nodes)} healthy")]
    more = len(problems) - SHOWN
    return problems[:SHOWN] + [("", CAUTION, f"and {more} more")] * (more > 0)


def checklist_html(state: ChecklistState, items: Sequence[PreflightCheck]) -> str:
    """Return the HTML: the present step, and the items that have not passed."""
    rows = []
    for item in items:
        if item.passed:
            continue
        level = CAUTION if item.name == state.step and not state.failed else LEVELS[item.passed]
        rows.append((level, MARKS[level], item.name, item.value, item.limit))
    return templates.render(
        "uam_lab.cockpit",
        "checklist.html.j2",
        colours=COLOURS,
        state=state,
        rows=rows,
        passed=sum(bool(item.passed) for item in items),
        count=len(items),
    )


class ChecklistPanel:
    """A folder at the top of the page; it appears with the first message of a checklist."""

    def __init__(
        self,
        gui: viser.GuiApi,
        services: Services,
        later: Later,
        said: Said,
    ) -> None:
        """later: passes a click to the thread that processes it; said: gets the answers."""
        self._gui, self._services, self._later, self._said = gui, services, later, said
        self._html: viser.GuiHtmlHandle | None = None
        self._buttons: dict[str, Any] = {}
        self._shown = ""

    def show(self, message: Any) -> None:
        state = ChecklistState.from_message(message)[1]
        shown = checklist_html(state, read_checks(message))
        if self._html is None:
            self._create()
        if shown != self._shown:
            self._html.content = self._shown = shown
        for name, enabled in (("confirm", state.needs == "confirm"), ("repeat", True)):
            if self._buttons[name].disabled == enabled:
                self._buttons[name].disabled = not enabled

    def _create(self) -> None:
        with self._gui.add_folder("Checklist", order=TOP):
            self._html = self._gui.add_html("")
            for label, name, icon in ACTIONS:
                button = self._gui.add_button(label, icon=getattr(viser.Icon, icon))
                button.on_click(lambda _, name=name: self._later(partial(self._call, name)))
                self._buttons[name] = button

    def _call(self, name: str) -> None:
        def answered(response: Trigger.Response | None, why: str) -> None:
            done = response is not None and response.success
            self._said(done, f"checklist: {why or response.message}")

        self._services.call(Trigger, f"checklist/{name}", Trigger.Request(), answered)
