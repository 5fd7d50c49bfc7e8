"""Side view of the mission: paths in the x-z plane with poses of vehicle and arm."""

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from uam_control.coordinates import ARM, ATTITUDE, POSITION, arm_coordinates
from uam_control.maths.rotations import quaternion_from_euler
from uam_control.vehicle import DEFAULT_VEHICLE
from uam_lab.records.results.timeseries import Series
from uam_lab.report.figures import style
from uam_lab.report.figures.panels import DrawnFlight, corner_legend, flight_keys
from uam_sim_bridge.plant.arm_geometry import outline
from uam_sim_bridge.plant.gripper import FINGERS
from uam_sim_bridge.plant.surroundings import PAYLOAD, PLACE
from uam_sim_bridge.plant.vehicle import BASE, ENVIRONMENT, SWING, Vehicle

POSES = 5
DASHES = (0, (3, 2))  # of the reference
TALLEST, ABOVE, BELOW = 4.5, 0.62, 0.45  # [in] of a panel, above it, below it
HIDDEN = 3  # group of the first geoms that MuJoCo does not draw
JOINT_WEIGHT = 0.2  # [m/rad] of the joints' motion in the distance between two poses
REACH = 0.35  # [m] shown around the path, for rotors and arm
OUT_OF_SIGHT = (50.0, 50.0, -1.0)


class Poses:
    """A MuJoCo model with its data, which can be set to any recorded state."""

    def __init__(self, series: Series):
        mass = series.info.get("payload_mass_kg") or 0.0
        self.series = series
        around = {key: series.info[key] for key in (ENVIRONMENT,) if key in series.info}
        vehicle = Vehicle.load(series.info.get("vehicle") or DEFAULT_VEHICLE)
        self.vehicle = vehicle.changed(around)
        self.model = self.vehicle.compile(mass)
        self.data = mujoco.MjData(self.model)
        self.has_payload = mass > 0.0 and not np.isnan(series["payload.x"]).all()
        joint = self.model.joint
        self._base, self._payload = (joint(n).qposadr[0] for n in (BASE, PAYLOAD))
        self._arm = joint(self.vehicle.description.joint_names[0]).qposadr[0]
        magnet = self.vehicle.description.has_magnet
        self._swing = joint(SWING).qposadr[0] if magnet else None
        hand = FINGERS if "gripper.opening" in series.columns else ()
        self._fingers = [joint(name).qposadr[0] for name in hand]

    def put(self, row: int) -> None:
        """Set the model to the pose in `row` of the series."""
        columns, values, qpos = self.series.columns, self.series.values[row], self.data.qpos
        chi = values[columns.block("truth.")][: columns.size]
        qpos[self._base : self._base + 3] = chi[POSITION]
        qpos[self._base + 3 : self._base + 7] = quaternion_from_euler(chi[ATTITUDE])
        qpos[self._arm : self._arm + columns.joints] = chi[ARM]
        if self._swing is not None:
            qpos[self._swing] = np.nan_to_num(values[columns["magnet.swing"]])
        if self._fingers:
            qpos[self._fingers] = 0.5 * np.nan_to_num(values[columns["gripper.opening"]])
        payload = values[columns.block("payload.")]
        if not self.has_payload or np.isnan(payload).any():
            payload = (*OUT_OF_SIGHT, 1.0, 0.0, 0.0, 0.0)
        qpos[self._payload : self._payload + 7] = payload
        mujoco.mj_kinematics(self.model, self.data)

    def edges(self, root: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the outline (m, 2) [m] in x and z, and the colour (4,), of each geom of the body
        `root` and of those that it carries, the farthest first."""
        model, data = self.model, self.data
        own = model.body_rootid[model.geom_bodyid] == model.body(root).id
        seen = np.flatnonzero(own & (model.geom_group < HIDDEN))
        for geom in seen[np.argsort(-data.geom_xpos[seen, 1], kind="stable")]:
            points, material = outline(model, data, geom)[:, [0, 2]], model.geom_matid[geom]
            edge = points[ConvexHull(points, qhull_options="QJ").vertices]
            yield edge, model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]


def path_figure(flights: Sequence[DrawnFlight]) -> Figure:
    """Draw one panel per part of the flight: before, during and after the magnet is on."""
    stretches = _stretches(flights[0].series)
    columns = len(stretches)
    across, up = _limits(flights)
    scale = 0.93 * style.WIDTH / columns / (across[1] - across[0])
    drawn = min(scale * (up[1] - up[0]), TALLEST)
    height = drawn + ABOVE + BELOW
    figure = Figure(figsize=(style.WIDTH, height))
    axes = figure.subplots(1, columns, sharex=True, sharey=True, squeeze=False)[0]
    figure.subplots_adjust(
        left=0.06, right=0.99, top=1.0 - ABOVE / height, bottom=BELOW / height, wspace=0.04
    )
    style.title(figure, "Path in the x-z plane")
    poses = Poses(flights[0].series)
    for axis, (name, start, end) in zip(axes, stretches, strict=True):
        _scenery(axis, poses)
        for number, flight in enumerate(flights):
            _path(axis, flight.series, start, end, number)
        _poses(axis, poses, start, end)
        axis.set_title(name, loc="left", fontsize=9.0, color=style.INK, pad=6)
        axis.set_xlabel("x [m]")
        axis.set(xlim=across, ylim=up, aspect="equal")
    axes[0].set_ylabel("z [m]")
    reference = style.key("reference", style.REFERENCE, 1.1, DASHES)
    corner_legend(figure, [reference, *flight_keys(flights)])
    return figure


def _limits(flights: Sequence[DrawnFlight]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges of x and z [m] that contain every path and the ground."""
    shown = [f.series.flown if f.series.flown.any() else slice(None) for f in flights]
    x = np.concatenate([f.series["truth.x"][s] for f, s in zip(flights, shown, strict=True)])
    z = np.concatenate([f.series["truth.z"][s] for f, s in zip(flights, shown, strict=True)])
    up = (min(z.min(), 0.0) - 0.05, z.max() + 0.25)
    middle, half = 0.5 * (x.min() + x.max()), 0.5 * (x.max() - x.min()) + REACH
    half = max(half, up[1] - up[0])  # at least twice as wide as high
    return (middle - half, middle + half), up


def _stretches(series: Series) -> list[tuple[str, float, float]]:
    """Return (name, first, last time [s]) of the parts between switchings of the magnet."""
    time = series.time[series.flown]
    if not len(time):
        return [("", float(series.time[0]), float(series.time[-1]))]
    spans = series.magnet_spans()
    if not spans:
        return [("", float(time[0]), float(time[-1]))]
    on, off = spans[0][0], spans[-1][1]
    return [
        (f"to the payload, 0 to {on:.0f} s", float(time[0]), on),
        (f"magnet on, {on:.0f} to {off:.0f} s", on, off),
        (f"back and down, {off:.0f} to {time[-1]:.0f} s", off, float(time[-1])),
    ]


def _path(axis: Axes, series: Series, start: float, end: float, number: int) -> None:
    rows = slice(series.row_at(start), series.row_at(end) + 1, max(1, len(series) // 6000))
    if number == 0:
        axis.plot(
            series["reference.x"][rows],
            series["reference.z"][rows],
            color=style.REFERENCE,
            linewidth=1.2,
            linestyle=DASHES,
            zorder=6,
        )
    axis.plot(
        series["truth.x"][rows],
        series["truth.z"][rows],
        color=style.flight_colour(number),
        linewidth=1.2,
        zorder=7,
    )


def _poses(axis: Axes, poses: Poses, start: float, end: float) -> None:
    """Draw vehicle, arm and payload at points evenly spaced along the path, the last darkest."""
    series = poses.series
    first, last = series.row_at(start), series.row_at(end)
    names = [f"reference.{name}" for name in ("x", "z", *arm_coordinates(series.columns.joints))]
    moving = np.column_stack([series[name][first : last + 1] for name in names])
    weights = [1.0, 1.0] + [JOINT_WEIGHT] * series.columns.joints
    # joint motion counts too; the small constant gives a hover a length
    way = np.append(0.0, np.cumsum(np.abs(np.diff(moving, axis=0)) @ weights + 1e-9))
    for number, part in enumerate(np.linspace(0.0, way[-1], POSES)):
        poses.put(first + int(np.searchsorted(way, part)))
        opacity = 0.25 + 0.75 * number / (POSES - 1)
        _pose(axis, poses, opacity, 8 + number)


def _pose(axis: Axes, poses: Poses, opacity: float, order: int) -> None:
    """Draw vehicle and payload."""
    _drawn(axis, poses, BASE, opacity, order)
    if poses.has_payload:
        _drawn(axis, poses, PAYLOAD, opacity, order)


def _scenery(axis: Axes, poses: Poses) -> None:
    poses.put(0)
    axis.axhline(0.0, color="#a7afb7", linewidth=1.0, zorder=1)
    _drawn(axis, poses, PLACE, 1.0, 2)


def _drawn(axis: Axes, poses: Poses, root: str, opacity: float, order: int) -> None:
    for edge, colour in poses.edges(root):
        look = {"facecolor": colour[:3], "edgecolor": style.INK, "linewidth": 0.4}
        axis.add_patch(Polygon(edge, alpha=opacity, zorder=order, **look))
