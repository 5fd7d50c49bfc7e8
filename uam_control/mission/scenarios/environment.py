"""The entry `environment` of a scenario: what stands around the vehicle.

Kinds: config/environment.yaml. The plant makes bodies of the entries; a real vehicle flies among
real ones.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

from uam_control.mission.scenarios.scenario import ScenarioError
from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section

ENVIRONMENT, PAYLOAD = "environment", "payload"
HEAVIEST = 5.0  # [kg] of a payload
FARTHEST = 50.0  # [m] of a place, and of a size
OVERHANG = 1e-6  # [m]
STEEPEST = 60.0  # [deg]


@cache
def _catalogue() -> dict[str, Any]:
    return read_section(configuration.path("environment.yaml"), ScenarioError).values


def default_environment() -> tuple[dict[str, Any], ...]:
    """Return the entries of a scenario that has none of its own."""
    where = f"{configuration.path('environment.yaml')}:"
    top = Section({ENVIRONMENT: _catalogue()["default"]}, where, ScenarioError)
    return read_environment(top) or ()


def usual_load() -> float:
    """Return the mass [kg] of the payload of `default_environment`."""
    return next(one["mass"] for one in default_environment() if one["kind"] == PAYLOAD)


def material(name: str) -> dict[str, Any]:
    """Return friction (3,) and rgba (4,) of a material."""
    return _catalogue()["materials"][name]


def thickness(part: str) -> float:
    """Return the thickness [m] of a part of the kinds."""
    return _catalogue()["parts"][part]


def read_environment(top: Section) -> tuple[dict[str, Any], ...] | None:
    """Return the checked entries of `environment`, with usual values for what they leave out; None
    if it is left out itself.

    Every entry has kind, name, position (3,) [m] of the middle of its lower side, yaw_deg and the
    keys of its kind. Raises the section's error.
    """
    if top.values.get(ENVIRONMENT) is None:
        return None
    found: list[dict[str, Any]] = []
    for entry in top.entries(ENVIRONMENT, True):
        kind = entry.one_of("kind", tuple(_catalogue()["kinds"]))
        usual = _catalogue()["kinds"][kind]
        on = ("rests_on",) if kind == PAYLOAD else ()
        entry.only(("kind", "name", "position", "yaw_deg", *usual, *on))
        made = {"kind": kind, "name": _name(entry, kind, found)}
        made["yaw_deg"] = entry.number("yaw_deg", default=0.0)
        made |= {key: _value(entry, key, value) for key, value in usual.items()}
        made["position"] = _place(entry, made, found)
        found.append(made)
    return tuple(found)


def _name(entry: Section, kind: str, before: Sequence[dict[str, Any]]) -> str:
    name = entry.text("name", default=kind)
    names = [one["name"] for one in before]
    if name in names:
        if entry.has("name"):
            raise entry.error("name", f"'{name}' is the name of another entry")
        name = next(f"{kind}_{i}" for i in range(2, 1000) if f"{kind}_{i}" not in names)
    return name


def _value(entry: Section, key: str, usual: Any) -> Any:
    """Return an entry of the same form as its usual value."""
    if key in ("size", "handle"):
        value = list(entry.numbers(key, len(usual) or 3, default=tuple(usual)))
        if not all(0.0 < one <= FARTHEST for one in value):
            raise entry.error(key, f"{value}: lengths above 0, at most {FARTHEST:g} m")
        return value
    if key == "material":
        return entry.one_of(key, tuple(_catalogue()["materials"]), default=usual)
    if key in ("boards", "board"):
        return entry.whole(key, 1 if key == "boards" else 0, 20, default=usual)
    if key == "mass":
        value = entry.number(key, default=usual)
        if not 0.0 <= value <= HEAVIEST:
            raise entry.error(key, f"{value:g} kg; 0 to {HEAVIEST:g} kg are possible")
        return value
    value = entry.positive(key, default=usual)
    most = STEEPEST if key == "angle_deg" else FARTHEST
    if value > most:
        raise entry.error(key, f"{value:g}; at most {most:g} is possible")
    return value


def _place(entry: Section, made: dict[str, Any], before: Sequence[dict[str, Any]]) -> list[float]:
    """Return the middle (3,) [m] of the lower side of an entry; a payload stands on another one."""
    on = None
    if entry.has("rests_on"):
        if not before:
            raise entry.error("rests_on", "no entry stands before it")
        names = {one["name"]: one for one in before}
        on = names[entry.one_of("rests_on", tuple(names))]
        if on["kind"] in ("slope", "wall", PAYLOAD):
            raise entry.error("rests_on", f"nothing stands on a {on['kind']}")
    if entry.has("position"):
        given = entry.entry("position")
        count = 3 if isinstance(given, list) and len(given) == 3 else 2
        place = list(entry.numbers("position", count))
        if max(map(abs, place)) > FARTHEST:
            raise entry.error("position", f"{place}: at most {FARTHEST:g} m away")
    elif on is not None:
        place = on["position"][:2]
    else:
        raise entry.error("position", "missing: [x, y] or [x, y, z] in m")
    if on is not None:
        if len(place) == 3:
            raise entry.error(
                "position", "[x, y] beside rests_on: the height is that of its upper side"
            )
        return [*place, _top(entry, on, place, made["board"])]
    if len(place) == 3 and place[2] < 0.0:
        raise entry.error("position", f"{place[2]:g} m is below the ground")
    return [*place, 0.0] if len(place) == 2 else place


def _top(entry: Section, on: dict[str, Any], place: Sequence[float], board: int) -> float:
    """Return the height [m] of an entry's upper side, of a shelf's board (0: the highest)."""
    turn = math.radians(on["yaw_deg"])
    x, y = (place[i] - on["position"][i] for i in range(2))
    inside = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    if any(abs(inside[i]) > on["size"][i] / 2 + OVERHANG for i in range(2)):
        raise entry.error("position", f"{list(place)} is beside {on['name']}")
    bottom = on["position"][2]
    if on["kind"] != "shelf":
        return round(bottom + on.get("height", on["size"][-1]), 9)
    if board > on["boards"]:
        raise entry.error("board", f"{board}; {on['name']} has {on['boards']}")
    return bottom + board_height(on, board or on["boards"])


def board_height(shelf: dict[str, Any], board: int) -> float:
    """Return the height [m] of the upper side of a board, 1 the lowest, above the shelf's foot."""
    return round(shelf["size"][2] * board / shelf["boards"], 9)
