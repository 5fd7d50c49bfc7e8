"""The page: headline and buttons left, the scene, charts and gains right."""

import math
import queue
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from uam_control.coordinates import ARM
from uam_control.vehicle import VehicleDescription
from uam_lab.cockpit.charts import Charts
from uam_lab.cockpit.commands import BUTTONS, GOAL, Button, Commands, Later
from uam_lab.cockpit.gains import NodeGains
from uam_lab.cockpit.hand_marker import HandMarker
from uam_lab.cockpit.headline import ChecklistPanel, headline
from uam_lab.cockpit.services import RemoteParameters, Services
from uam_lab.cockpit.texts import shown
from uam_lab.cockpit.vehicle_health import Health
from uam_lab.cockpit.vehicle_view import VehicleView
from uam_lab.cockpit.watch import Watch
from uam_lab.cockpit.web import PlainPage
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import read_checks
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.status import AutopilotState, MissionStatus
from uam_msgs_py.messages.tf_message import read_transforms
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.namespace import prefix

# nodes whose parameters are shown, and what their tabs are called
TUNED = {
    "position_controller": "Position",
    "attitude_controller": "Attitude",
    "arm_controller": "Arm",
    "state_estimator": "Estimator",
    "mission": "Mission",
    "mavlink_bridge": "Bridge",
}
LINES = 6  # answers and changes shown on the page
RETRY = 2.0  # [s] wall time between two searches for nodes and services
LEFT_WIDTH, RIGHT_WIDTH = 330, 400  # [px]


class CommandButtons:
    """The buttons on the page. `later` passes a click to the thread that processes it."""

    def __init__(self, gui: viser.GuiApi, commands: Commands, later: Later):
        self._gui, self._commands, self._later = gui, commands, later
        self._handles = []
        for button in BUTTONS:
            handle = gui.add_button(
                button.label,
                icon=getattr(viser.Icon, button.icon),
                hint=button.hint,
                color=button.colour,
            )
            handle.on_click(lambda _, chosen=button: later(lambda: self._pressed(chosen)))
            self._handles.append((button, handle))
        with gui.add_form(None) as form:
            goal = gui.add_text("Go to", "", hint=f"{GOAL}; height and heading may be left out")
            send = gui.add_button("Go", icon=viser.Icon.MAP_PIN)
        for sent in (form.on_submit, send.on_click):
            sent(lambda _: later(lambda: commands.goto(goal.value)))

    def look(self) -> None:
        """Enable the buttons that the present state allows; the others say why not."""
        for button, handle in self._handles:
            why = self._commands.refusal(button)
            hint = f"{button.hint}: {why}" if why else button.hint
            if (handle.disabled, handle.hint) != (bool(why), hint):
                handle.disabled, handle.hint = bool(why), hint

    def _pressed(self, button: Button) -> None:
        question = self._commands.question(button)
        if not question:
            self._commands.call(button)
            return
        with self._gui.add_modal(button.label) as modal:
            self._gui.add_html(shown([question]))
            # first, as the browser gives it the keyboard: Enter and space must not confirm
            no = self._gui.add_button("Cancel")
            yes = self._gui.add_button(button.label, color=button.colour)

        def agreed(_: viser.GuiEvent) -> None:
            modal.close()
            self._later(lambda: self._commands.call(button))

        yes.on_click(agreed)
        no.on_click(lambda _: modal.close())


class Page:
    """One page for one ROS domain; one thread calls `look` periodically."""

    def __init__(
        self,
        server: viser.ViserServer,
        watch: Watch,
        services: Services,
        options: dict[str, Any],
        vehicle: VehicleDescription,
        plain: PlainPage,
        todo: queue.SimpleQueue[Callable[[], None]],
        namespace: str = "/",
    ):
        """options: config/views/cockpit.yaml; plain: shows the same without the scene; todo:
        clicks, processed by `look`; namespace: of the vehicle's nodes."""
        self._server, self._options = server, options
        self._todo, self._plain = todo, plain
        self._answers_seen: int | None = None
        self._watch, self._services = watch, services
        self._health = Health(options["silent_after"], namespace, period=vehicle.control_period)
        self._lines: deque[str] = deque(maxlen=LINES)
        self._gains: dict[str, NodeGains] = {}
        self._asked: set[str] = set()
        self._due = dict.fromkeys(("charts", "nodes"), 0.0)

        gui, camera = server.gui, options["camera"]
        server.initial_camera.position = tuple(camera["position"])
        server.initial_camera.look_at = tuple(camera["look_at"])
        gui.configure_theme(show_logo=False, show_share_button=False)
        self._view = VehicleView(server.scene, prefix(namespace))
        self._headline = gui.add_html("")
        self._shown = ""
        with gui.add_folder("Commands"):
            self._commands = Commands(self._services, self._health, self.say)
            self._buttons = CommandButtons(gui, self._commands, self._todo.put)
        self._hand = HandMarker(server, self._view, self._commands, vehicle, self._todo.put)
        self._checklist = ChecklistPanel(gui, self._services, self._todo.put, self.say)
        self._follow = gui.add_checkbox("Camera follows the vehicle", False)
        self._answers = gui.add_html("")
        self._followed = np.zeros(3)
        self._mission_values: dict[str, Any] = {}
        gui.main_panel.dock_left()
        gui.main_panel.set_width(LEFT_WIDTH)
        self._panel = gui.add_panel()
        self._charts = Charts(
            gui,
            self._panel,
            options["window"],
            options["sample_interval"],
            vehicle.coordinates[ARM],
            bool(vehicle.end_effector),
        )
        self._coordinates = vehicle.coordinates
        self._panel.dock_right()
        self._panel.set_width(RIGHT_WIDTH)
        self._tabs = {name: self._panel.add_tab(title) for name, title in TUNED.items()}

    def look(self) -> None:
        """Show new messages and process clicks."""
        while not self._todo.empty():
            self._todo.get()()
        self._services.look()
        with self._server.atomic():
            self._watch.look(self._take)
            self._move_cameras()
        now = time.monotonic()
        for gains in self._gains.values():
            gains.look()
        if now >= self._due["charts"]:
            self._due["charts"] = now + self._options["chart_period"]
            self._charts.draw()
            self._hand.look()
            self._update_headline()
        if now >= self._due["nodes"]:
            self._due["nodes"] = now + RETRY
            if self._health.mission is not None:
                for topic in (topics.GOAL_POSE, topics.END_EFFECTOR_GOAL):
                    self._services.offer(topic)
            self._find_nodes()

    def end(self) -> bool:
        """Show the last messages; return whether they end the flight: pages must still ask once."""
        self._watch.look(self._take)
        self._update_headline()
        return self._over

    def say(self, done: bool, text: str) -> None:
        """Add a line to the answers; a failure is also shown as a notification."""
        self._lines.appendleft(text)
        self._answers.content = shown(self._lines)
        if not done:
            for client in self._server.get_clients().values():
                client.add_notification("Refused", text, auto_close_seconds=8.0, color="red")

    @property
    def _over(self) -> bool:
        mission = self._health.mission
        return mission is not None and mission.done

    def _update_headline(self) -> None:
        self._health.silence = self._watch.silence
        self._health.refused = self._watch.door.refusals.count
        found = headline(self._health, self._options)
        if found != self._shown:
            self._headline.content = self._shown = found
        self._plain.show(found, list(self._lines), self._over, self._commands)
        self._buttons.look()

    def _take(self, topic: Topic, message: Any) -> None:
        health = self._health
        if topic is topics.MISSION_STATUS:
            self._see_mission(MissionStatus.from_message(message)[1])
        elif topic is topics.AUTOPILOT_STATE:
            health.autopilot = AutopilotState.from_message(message)[1]
        elif topic is topics.PREFLIGHT:
            health.preflight = read_checks(message)
        elif topic is topics.CHECKLIST:
            self._checklist.show(message)
        elif topic is topics.CHANGES:
            self._changed(ParameterChange.from_message(message)[1])
        elif topic is topics.DIAGNOSTICS:
            health.diagnose(message)
        elif topic is topics.AUTOPILOT_BATTERY:
            health.battery = message.percentage
        elif topic is topics.ROBOT_DESCRIPTION:
            self._view.describe(message)
        elif topic in (topics.TF, topics.TF_STATIC):
            self._view.transforms(read_transforms(message))
        elif topic is topics.MARKERS:
            self._view.markers(message)
        else:
            self._charts.show(topic, message)
        if topic is topics.TRACKING_ERROR:
            health.track(np.array(message.position[: len(self._coordinates)]))

    def _see_mission(self, mission: MissionStatus) -> None:
        """Take the mission's status, and say its answer to a goal."""
        if self._answers_seen not in (None, mission.answers):
            self.say(": refused" not in mission.answer, mission.answer)
        self._answers_seen = mission.answers
        self._health.set_mission(mission)

    def _changed(self, change: ParameterChange) -> None:
        if not change.accepted:
            return
        new = {name: values[1] for name, values in change.values.items()}
        for name, value in new.items():
            self.say(True, f"{change.node}: {name} = {value}")
        if "adapt" in new:
            mark = self._health.frozen.discard if new["adapt"] else self._health.frozen.add
            mark(change.node)
        self._know(change.node, new)
        if change.node in self._gains:
            self._gains[change.node].changed(new)

    def _know(self, node: str, values: dict[str, Any]) -> None:
        """Take the limits that the headline shows from the parameters of a node."""
        if node == "mission":
            self._mission_values |= values
            self._hand.reach.know(self._mission_values)
            health = self._health
            known = zip(("delay_warn", "delay_land"), health.delay_shares, strict=True)
            health.delay_shares = tuple(float(values.get(name, old)) for name, old in known)

    def spare(self, sparing: bool) -> None:
        """Do without the charts of each tick, or show them again."""
        self._watch.spare(sparing)
        self._health.sparing = sparing

    def _find_nodes(self) -> None:
        """Load the parameters of nodes that have appeared."""
        for name in TUNED:
            if name in self._asked:
                continue
            remote = RemoteParameters(self._services, name)
            if remote.is_there:
                self._asked.add(name)
                remote.load(lambda why, remote=remote: self._loaded(remote, why))

    def _loaded(self, remote: RemoteParameters, why: str) -> None:
        if why:
            self._asked.discard(remote.node)
            return
        self._know(remote.node, remote.values)
        frozen = remote.values.get("adapt") is False
        if frozen:
            self._health.frozen.add(remote.node)
        gui, tab = self._server.gui, self._tabs[remote.node]
        self._gains[remote.node] = NodeGains(gui, tab, remote, self._todo.put, self.say)

    def _move_cameras(self) -> None:
        moved = self._view.vehicle - self._followed
        self._followed = self._view.vehicle
        if not self._follow.value or not math.isfinite(moved.sum()) or not moved.any():
            return
        for client in self._server.get_clients().values():
            client.camera.position = client.camera.position + moved
            client.camera.look_at = client.camera.look_at + moved
