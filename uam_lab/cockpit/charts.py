"""The charts of the page: strip charts of the last seconds, and the messages with their data."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from viser import uplot

from uam_control.coordinates import ARM, ATTITUDE, BASE_COORDINATES, POSITION
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.topics import Topic

XYZ, RPY = BASE_COORDINATES[POSITION], BASE_COORDINATES[ATTITUDE]
DEGREES = 180.0 / math.pi
ADAPTATION = {
    topics.POSITION_ADAPTATION: "position",
    topics.ATTITUDE_ADAPTATION: "attitude",
    topics.ARM_ADAPTATION: "arm",
}
COLOURS = ("#1f5fa8", "#d95f02", "#1b8a5a", "#8e3b9e", "#c0a000", "#666666")
SMALLEST = 1e-9  # shown in place of zero on a logarithmic axis
HEIGHT = 150  # [px]


class StripChart:
    """One chart of the page: `add` stores samples, `draw` sends them to the page."""

    def __init__(
        self,
        gui: viser.GuiApi,
        title: str,
        names: Sequence[str],
        times: tuple[float, float],
        logarithmic: bool = False,
    ):
        """title: with unit; names: of the series; times: shown time [s], minimum time between two
        stored samples [s]; logarithmic: scale of the y axis."""
        self._count, self._logarithmic = len(names), logarithmic
        self._window, self._interval = times
        self._rows: deque[tuple[float, ...]] = deque()
        series = [uplot.Series(label="t [s]")]
        series += [
            uplot.Series(label=name, stroke=colour, width=1.5, points={"show": False})
            for name, colour in zip(names, COLOURS, strict=False)
        ]
        scales = {"x": {"time": False}, "y": {"distr": 3 if logarithmic else 1}}
        axes = ({"size": 34}, {"size": 58})
        self._handle = gui.add_uplot(
            tuple(np.zeros(1) + SMALLEST for _ in series),
            tuple(series),
            title=title,
            scales=scales,
            axes=axes,
            height=HEIGHT,
        )
        self._new = False

    def add(self, time: float, values: Sequence[float]) -> None:
        """Store a sample (n,) at time [s]; ignore it if its length is wrong or it is not finite."""
        rows = self._rows
        if len(values) != self._count or not np.all(np.isfinite(values)):
            return
        if rows and time < rows[-1][0]:  # another flight has begun
            rows.clear()
        if rows and time < rows[-1][0] + self._interval:
            return
        rows.append((time, *values))
        while rows[0][0] < time - self._window:
            rows.popleft()
        self._new = True

    def draw(self) -> None:
        """Send new samples to the page."""
        if not self._new:
            return
        self._new = False
        columns = np.array(self._rows).T
        if self._logarithmic:
            columns[1:] = np.maximum(columns[1:], SMALLEST)
        self._handle.data = tuple(np.ascontiguousarray(column) for column in columns)


class Charts:
    """Three tabs of charts; `show` stores data of a message, `draw` sends new data."""

    def __init__(
        self,
        gui: viser.GuiApi,
        panel: viser.PanelHandle,
        window: float,
        interval: float,
        joints: Sequence[str],
        hand: bool,
    ):
        """window: shown time [s]; interval: between samples [s]; hand: there is an end effector."""
        self._gui, self._times = gui, (window, interval)
        self._joints = len(joints)
        self._charts: list[StripChart] = []
        self._adaptation: dict[Topic, StripChart] = {}
        with panel.add_tab("Errors", viser.Icon.CHART_LINE):
            self._position = self._chart("Position error [cm]", XYZ)
            self._attitude = self._chart("Attitude error [deg]", RPY)
            self._arm = self._chart("Arm error [deg]", joints)
            self._hand = self._chart("End effector error [mm]", XYZ) if hand else None
        with panel.add_tab("Inputs", viser.Icon.BOLT):
            self._force = self._chart("tau_p [N, world]", XYZ)
            self._torque = self._chart("tau_q [N m, body]", RPY)
            self._effort = self._chart("tau_alpha [N m]", joints)
            self._thrust = self._chart("Thrust setpoint [0..1]", ("thrust",))
            self._rates = self._chart("Body rate setpoint [deg/s]", XYZ)
        self._adaptation_tab = panel.add_tab("Adaptation", viser.Icon.ADJUSTMENTS)

    def _chart(self, title: str, names: Sequence[str], logarithmic: bool = False) -> StripChart:
        self._charts.append(StripChart(self._gui, title, names, self._times, logarithmic))
        return self._charts[-1]

    def show(self, topic: Topic, message: Any) -> None:
        """Store the data of a message if its topic is plotted."""
        if topic is topics.TRACKING_ERROR:
            time, error = _time(message), message.position
            self._position.add(time, [100.0 * value for value in error[POSITION]])
            self._attitude.add(time, [DEGREES * value for value in error[ATTITUDE]])
            arm, hand = np.split(np.array(error[ARM]), [self._joints])
            self._arm.add(time, list(DEGREES * arm))
            if self._hand is not None and len(hand):
                self._hand.add(time, list(1e3 * hand))
        elif topic is topics.POSITION_COMMAND:
            self._force.add(_time(message), _effort(message, 3))
        elif topic is topics.ATTITUDE_COMMAND:
            self._torque.add(_time(message), _effort(message, 3))
        elif topic is topics.ARM_COMMAND:
            self._effort.add(_time(message), _effort(message, self._joints))
        elif topic is topics.SETPOINT:
            time, rates = _time(message), message.twist.angular
            self._thrust.add(time, [message.twist.linear.z])
            self._rates.add(time, [DEGREES * value for value in (rates.x, rates.y, rates.z)])
        elif topic in ADAPTATION:
            self._adapted(topic, message)

    def _adapted(self, topic: Topic, message: JointState) -> None:
        """Plot adapted gains by the names in the message, which come from the law."""
        if topic not in self._adaptation:
            with self._adaptation_tab:
                title = f"Adapted gains, {ADAPTATION[topic]}"
                self._adaptation[topic] = self._chart(title, message.name, logarithmic=True)
        self._adaptation[topic].add(_time(message), list(message.position))

    def draw(self) -> None:
        """Send new data to the page."""
        for chart in self._charts:
            chart.draw()


def _time(message: JointState | JointTrajectory | TwistStamped) -> float:
    """Return the stamp [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def _effort(message: JointTrajectory, count: int) -> list[float]:
    """Return the first `count` efforts of a trajectory's point; empty without a command."""
    return list(message.points[0].effort[:count]) if message.points else []
