"""The headline of the page: state of the vehicle, phase of the mission, tracking errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from uam_lab.cockpit.vehicle_health import BAD, CAUTION, GOOD, UNKNOWN, Health, grade

COLOURS = {GOOD: "#1b8a5a", CAUTION: "#c77700", BAD: "#c62828", UNKNOWN: "#777777"}
MARKS = {GOOD: "●", CAUTION: "▲", BAD: "■", UNKNOWN: "○"}
SHOWN = 4  # largest number of listed nodes with problems


def headline(health: Health, limits: Mapping[str, list[float]]) -> str:
    """Return the HTML; limits: pairs (caution, bad) of config/views/cockpit.yaml by name."""
    return "".join(
        (_banner(health), _errors(health, limits), _facts(health, limits), _nodes(health))
    )


def _banner(health: Health) -> str:
    level, words, why = health.state()
    mission = health.mission
    time = f"T {mission.time:+.1f} s" if mission is not None and mission.time >= 0.0 else ""
    below = "<br>".join(filter(None, (escape(why), time)))
    return (
        f'<div id="uam-state" style="background:{COLOURS[level]};color:white;border-radius:6px;'
        'padding:6px 10px;margin:2px 0 6px 0"><div style="font-size:1.5em;font-weight:700;'
        f'line-height:1.15">{escape(words.upper())}</div><div>{below}</div></div>'
    )


def _errors(health: Health, limits: Mapping[str, list[float]]) -> str:
    tiles = [
        ("position", "position_error", 100.0, "cm"),
        ("attitude", "attitude_error", math.degrees(1.0), "°"),
        ("arm", "arm_error", math.degrees(1.0), "°"),
    ]
    cells = []
    for (title, name, factor, unit), value in zip(tiles, health.errors, strict=True):
        level = grade(value, *limits[name])
        text = f"{factor * value:.1f}" if math.isfinite(value) else "–"
        share = min(1.0, value / limits[name][1]) if math.isfinite(value) else 0.0
        cells.append(
            '<div style="flex:1;text-align:center">'
            f'<div style="font-size:0.8em">{title} error</div>'
            f'<div style="font-size:1.5em;font-weight:700;color:{COLOURS[level]}">{text}'
            f'<span style="font-size:0.6em"> {unit}</span></div>'
            '<div style="height:5px;background:#ddd;border-radius:3px;margin:0 6px">'
            f'<div style="height:5px;border-radius:3px;width:{100.0 * share:.0f}%;'
            f'background:{COLOURS[level]}"></div></div></div>'
        )
    return f'<div id="uam-errors" style="display:flex;margin-bottom:6px">{"".join(cells)}</div>'


def _facts(health: Health, limits: Mapping[str, list[float]]) -> str:
    autopilot, mission = health.autopilot, health.mission
    level = GOOD if autopilot is not None and autopilot.connected else CAUTION
    summary = "no message" if autopilot is None else autopilot.summary
    rows = [("autopilot", level, summary)]
    if autopilot is not None and autopilot.reasons:
        rows.append(("", CAUTION, autopilot.reasons))
    if math.isfinite(health.battery):
        rows.append(("battery", grade(health.battery, *limits["battery"]), f"{health.battery:.0%}"))
    rows.append(("magnet", GOOD, "on" if mission is not None and mission.magnet else "off"))
    if health.frozen:
        rows.append(("adaptation", CAUTION, "frozen: " + ", ".join(sorted(health.frozen))))
    if health.saturated:
        rows.append(("saturated", CAUTION, ", ".join(sorted(health.saturated))))
    if health.real_time_factor:
        rows.append(("speed", GOOD, f"{health.real_time_factor} × real time"))
    return _table(rows)


def _nodes(health: Health) -> str:
    ailing = health.ailing()
    if not health.nodes:
        return _table([("nodes", UNKNOWN, "no message")])
    if not ailing:
        return _table([("nodes", GOOD, f"all {len(health.nodes)} healthy")])
    rows = [(name, level, what) for name, level, what in ailing[:SHOWN]]
    if len(ailing) > SHOWN:
        rows.append(("", CAUTION, f"and {len(ailing) - SHOWN} more"))
    return _table(rows)


def _table(rows: list[tuple[str, str, str]]) -> str:
    lines = [
        f'<div style="display:flex;gap:6px"><span style="color:{COLOURS[level]}">{MARKS[level]}'
        f'</span><span style="min-width:5em;flex-shrink:0;opacity:0.7">{escape(name)}</span>'
        f"<span>{escape(text)}</span></div>"
        for name, level, text in rows
    ]
    return f'<div style="font-size:0.9em;line-height:1.45">{"".join(lines)}</div>'
