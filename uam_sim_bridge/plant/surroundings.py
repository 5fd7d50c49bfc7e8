"""Bodies of the entries `environment` of a scenario in the plant's model."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from uam_control.mission.scenarios.environment import PAYLOAD, board_height, material, thickness
from uam_sim_bridge.plant.arm_geometry import BASE, carriers

PLACE = "environment"  # body of parts/world.xml, before the vehicle: its contacts come first
TYPES = mujoco.mjtGeom
WORLD, VEHICLE_AND_LOAD = 1, 14  # contype, conaffinity: see parts/world.xml
LOAD, LOAD_WITH = 4, 7
PLATE = 0.0005  # [m] half thickness of a payload's steel plate
RIM = 0.004  # [m] of a payload beside its plate
VEHICLE = "the vehicle"
Entry = dict[str, Any]


def add_surroundings(spec: mujoco.MjSpec, entries: Sequence[Entry], payload_mass: float) -> None:
    """Add the entries; payload_mass [kg]: of the first payload, the one that is tracked.

    A model without such an entry gets one, out of sight: the plant's arrays stay the same.
    """
    for old in (PAYLOAD, "stand", "drop_mat"):  # of a vehicle file with surroundings of its own
        if (body := spec.body(old)) is not None:
            spec.delete(body)
    place = spec.body(PLACE) or spec.worldbody.add_body(name=PLACE)
    payloads = [one for one in entries if one["kind"] == PAYLOAD]
    for entry in entries:
        if entry["kind"] != PAYLOAD:
            body = place.add_body(
                name=entry["name"], pos=entry["position"], quat=_turned(entry["yaw_deg"])
            )
            BUILDERS[entry["kind"]](body, entry)
    hidden = {"kind": PAYLOAD, "position": [50.0, 50.0, 0.0], "yaw_deg": 0.0}
    hidden |= {"size": [0.06, 0.06, 0.04], "material": "plastic", "mass": 0.0}
    for i, entry in enumerate(payloads or [hidden]):
        name = PAYLOAD if i == 0 else entry["name"]
        mass = max(payload_mass if i == 0 else entry["mass"], 1e-3)
        _add_payload(spec.worldbody, name, entry, mass)


def _turned(yaw_deg: float) -> list[float]:
    half = 0.5 * math.radians(yaw_deg)
    return [math.cos(half), 0.0, 0.0, math.sin(half)]


def _add_payload(world: mujoco.MjsBody, name: str, entry: Entry, mass: float) -> None:
    half = [0.5 * length for length in entry["size"]]
    x, y, z = entry["position"]
    body = world.add_body(
        name=name, pos=[x, y, round(z + half[2], 9)], quat=_turned(entry["yaw_deg"])
    )
    body.add_freejoint(name=name)
    made = material(entry["material"])
    look = {"rgba": made["rgba"], "friction": made["friction"]}
    solid = look | {"type": TYPES.mjGEOM_BOX, "contype": LOAD, "conaffinity": LOAD_WITH}
    body.add_geom(name=name, size=half, mass=mass, **solid)
    if handle := entry.get("handle"):
        stem = [0.5 * length for length in handle]
        top = [0.0, 0.0, half[2] + stem[2]]
        body.add_geom(name=f"{name}_handle", size=stem, pos=top, mass=0.0, **solid)
    body.add_geom(
        name=f"{name}_plate",
        type=TYPES.mjGEOM_BOX,
        size=[max(half[0] - RIM, RIM), max(half[1] - RIM, RIM), PLATE],
        pos=[0.0, 0.0, half[2]],
        mass=0.0,
        material="steel",
    )


def _solid(
    body: mujoco.MjsBody, entry: Entry, name: str, size: Sequence[float], **how: Any
) -> None:
    """Add a box that everything meets; size: half lengths (3,) [m]."""
    made = material(entry["material"])
    body.add_geom(
        name=f"{entry['name']}_{name}" if name else entry["name"],
        type=TYPES.mjGEOM_BOX,
        size=size,
        contype=WORLD,
        conaffinity=VEHICLE_AND_LOAD,
        rgba=made["rgba"],
        friction=made["friction"],
        **how,
    )


def _stand(body: mujoco.MjsBody, entry: Entry) -> None:
    height, foot = entry["height"], 0.5 * thickness("foot_height")
    top, rgba = 0.5 * thickness("board"), material(entry["material"])["rgba"]
    post = round(0.5 * (height - 2.0 * top), 9)
    for name, size, z in (
        ("post", [thickness("post"), post, 0.0], post),
        ("foot", [thickness("foot"), foot, 0.0], foot),
    ):
        body.add_geom(
            name=f"{entry['name']}_{name}",
            type=TYPES.mjGEOM_CYLINDER,
            size=size,
            pos=[0.0, 0.0, z],
            rgba=rgba,
        )
    half = [0.5 * length for length in entry["size"]]
    _solid(body, entry, "top", [*half, top], pos=[0.0, 0.0, round(height - top, 9)])


def _table(body: mujoco.MjsBody, entry: Entry) -> None:
    height, (x, y) = entry["height"], (0.5 * length for length in entry["size"])
    plank, leg = 0.5 * thickness("plank"), 0.5 * thickness("leg")
    _solid(body, entry, "top", [x, y, plank], pos=[0.0, 0.0, height - plank])
    under = 0.5 * (height - 2.0 * plank)
    for i, (along, across) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1)), 1):
        place = [along * (x - leg), across * (y - leg), under]
        _solid(body, entry, f"leg_{i}", [leg, leg, under], pos=place)


def _shelf(body: mujoco.MjsBody, entry: Entry) -> None:
    """Boards, two sides and a back; it is open towards its -x."""
    depth, width, height = (0.5 * length for length in entry["size"])
    plank = 0.5 * thickness("plank")
    for board in range(1, entry["boards"] + 1):
        z = board_height(entry, board) - plank
        _solid(body, entry, f"board_{board}", [depth, width, plank], pos=[0.0, 0.0, z])
    for name, side in (("left", 1.0), ("right", -1.0)):
        place = [0.0, side * (width + plank), height]
        _solid(body, entry, name, [depth, plank, height], pos=place)
    place = [depth + plank, 0.0, height]
    _solid(body, entry, "back", [plank, width + 2.0 * plank, height], pos=place)


def _slope(body: mujoco.MjsBody, entry: Entry) -> None:
    """A board that rises towards its +x; its lower edge lies on the ground."""
    x, y = (0.5 * length for length in entry["size"])
    angle, plank = math.radians(entry["angle_deg"]), 0.5 * thickness("plank")
    turn = [math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0]
    rise = x * math.sin(angle) + plank * math.cos(angle)
    _solid(body, entry, "", [x, y, plank], pos=[0.0, 0.0, rise], quat=turn)


def _block(body: mujoco.MjsBody, entry: Entry) -> None:
    half = [0.5 * length for length in entry["size"]]
    soft = {"priority": 1, "solref": [0.04, 1.2]} if entry["kind"] == "mat" else {}
    _solid(body, entry, "", half, pos=[0.0, 0.0, half[2]], **soft)


BUILDERS: dict[str, Callable[[mujoco.MjsBody, Entry], None]] = {
    "stand": _stand,
    "table": _table,
    "shelf": _shelf,
    "slope": _slope,
    "wall": _block,
    "box": _block,
    "mat": _block,
}


def shapes(model: mujoco.MjModel, entries: Sequence[Entry]) -> dict[str, np.ndarray]:
    """Return the geoms of each entry and, under VEHICLE, those of the vehicle."""
    tracked = next((one for one in entries if one["kind"] == PAYLOAD), None)
    names = {PAYLOAD if one is tracked else one["name"]: one["name"] for one in entries}
    names[BASE] = VEHICLE
    found: dict[str, list[int]] = {name: [] for name in names.values()}
    for geom in range(model.ngeom):
        carrying = (model.body(one).name for one in carriers(model, model.geom_bodyid[geom]))
        if name := next((one for one in carrying if one in names), ""):
            found[names[name]].append(geom)
    return {name: np.array(geoms, int) for name, geoms in found.items()}


def distance(
    model: mujoco.MjModel, data: mujoco.MjData, ones: np.ndarray, others: np.ndarray, far: float
) -> float:
    """Return the smallest distance [m] between geoms of two parts, negative where they intersect;
    `far` if it is larger."""
    apart = np.linalg.norm(data.geom_xpos[ones, None] - data.geom_xpos[None, others], axis=2)
    apart -= model.geom_rbound[ones, None] + model.geom_rbound[None, others]
    near = zip(*np.nonzero(apart < far), strict=True)
    pairs = ((int(ones[i]), int(others[j])) for i, j in near)
    return min(
        (mujoco.mj_geomDistance(model, data, a, b, far, np.zeros(6)) for a, b in pairs), default=far
    )


def overlapping(
    model: mujoco.MjModel, data: mujoco.MjData, entries: Sequence[Entry], slack: float
) -> tuple[str, str, float] | None:
    """Return names and depth [m] of the first two that intersect: two entries, or an entry and the
    vehicle at the pose in `data`; slack [m]: by which they may."""
    mujoco.mj_kinematics(model, data)
    for one, other in itertools.combinations(shapes(model, entries).items(), 2):
        reach = distance(model, data, one[1], other[1], slack)
        if reach < -slack:
            return one[0], other[0], -reach
    return None
