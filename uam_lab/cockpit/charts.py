"""The charts of the page, and the messages with their data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import viser
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from uam_control.coordinates import ARM, ATTITUDE, BASE_COORDINATES, POSITION
from uam_lab.cockpit.strip_chart import Chart, StripChart
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.topics import Topic

XYZ, RPY = BASE_COORDINATES[POSITION], BASE_COORDINATES[ATTITUDE]
DEGREES = 180.0 / math.pi
ADAPTATION = {
    topics.POSITION_ADAPTATION: "position",
    topics.ATTITUDE_ADAPTATION: "attitude",
    topics.ARM_ADAPTATION: "arm",
}


class Charts:
    """Three tabs of charts; `show` stores data of a message, `draw` sends new data."""

    def __init__(
        self,
        gui: viser.GuiApi,
        panel: viser.PanelHandle,
        window: float,
        interval: float,
        joints: Sequence[str],
    ):
        """window: shown time [s]; interval: between samples [s]; joints: their names."""
        self._gui, self._window, self._interval = gui, window, interval
        self._joints = len(joints)
        self._adaptation: dict[Topic, StripChart] = {}
        with panel.add_tab("Errors", viser.Icon.CHART_LINE):
            self._position = self._chart("Position error [cm]", XYZ)
            self._attitude = self._chart("Attitude error [deg]", RPY)
            self._arm = self._chart("Arm error [deg]", joints)
        with panel.add_tab("Inputs", viser.Icon.BOLT):
            self._force = self._chart("tau_p [N, world]", XYZ)
            self._torque = self._chart("tau_q [N m, body]", RPY)
            self._effort = self._chart("tau_alpha [N m]", joints)
            self._thrust = self._chart("Thrust setpoint [0..1]", ("thrust",))
            self._rates = self._chart("Body rate setpoint [deg/s]", XYZ)
        self._adaptation_tab = panel.add_tab("Adaptation", viser.Icon.ADJUSTMENTS)

    def _chart(self, title: str, names: Sequence[str], logarithmic: bool = False) -> StripChart:
        chart = Chart(title, tuple(names), logarithmic)
        return StripChart(self._gui, chart, self._window, self._interval)

    def show(self, topic: Topic, message: Any) -> None:
        """Store the data of a message if its topic is plotted."""
        if topic is topics.TRACKING_ERROR:
            time, error = _time(message), message.position
            self._position.add(time, [100.0 * value for value in error[POSITION]])
            self._attitude.add(time, [DEGREES * value for value in error[ATTITUDE]])
            self._arm.add(time, [DEGREES * value for value in error[ARM]])
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
        fixed = (
            self._position,
            self._attitude,
            self._arm,
            self._force,
            self._torque,
            self._effort,
            self._thrust,
            self._rates,
        )
        for chart in (*fixed, *self._adaptation.values()):
            chart.draw()


def _time(message: JointState | JointTrajectory | TwistStamped) -> float:
    """Return the stamp [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def _effort(message: JointTrajectory, count: int) -> list[float]:
    """Return the first `count` efforts of a trajectory's point; empty without a command."""
    return list(message.points[0].effort[:count]) if message.points else []
