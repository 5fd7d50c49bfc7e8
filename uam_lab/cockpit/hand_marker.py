"""The hand's goal in the scene: a marker to drag, whether it can be reached, and a button to go."""

import math
from typing import Any

import numpy as np
import viser

from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DDOT, POSITION, Z
from uam_control.mission import MissionParameters
from uam_control.mission.hand_goals import HandPose
from uam_control.mission.motion.flatness import Flyer
from uam_control.mission.plans import PlanRefused
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import VehicleDescription
from uam_lab.cockpit.commands import Commands, Later
from uam_lab.cockpit.texts import shown
from uam_lab.cockpit.vehicle_view import VehicleView
from uam_msgs_py.messages.topics import TOOL, WORLD

PATH = f"/{WORLD}/hand_goal"
SIZE, BALL = 0.25, 0.025  # [m] of the arrows and of the ball
GOOD, BAD = (27, 138, 90), (198, 40, 40)  # colours of the ball


class Reach:
    """Whether a hand can be brought to a place, by the mission's limits."""

    def __init__(self, vehicle: VehicleDescription) -> None:
        self._flyer = Flyer.with_hand(vehicle)
        self._stowed = np.array(vehicle.stowed)
        self._limits: MissionParameters | None = None
        self._ground = math.inf  # [m] lowest height of the vehicle so far

    @property
    def has_hand(self) -> bool:
        """Whether the vehicle has an end effector."""
        return self._flyer is not None

    def know(self, values: dict[str, Any]) -> None:
        """Take the parameters of the mission; those that are no longer a set leave the old ones."""
        try:
            self._limits = MissionParameters.among(values, len(self._stowed))
        except ParameterError:
            return

    def see(self, place: np.ndarray) -> None:
        """Take the place (3,) [m] of the vehicle: where it has stood is the ground."""
        if np.isfinite(place).all():
            self._ground = min(self._ground, float(place[Z]))

    def refusal(self, place: np.ndarray) -> str:
        """Return why the hand cannot be at place (3,) [m], "" if it can, or if nothing is known."""
        if self._limits is None or not math.isfinite(self._ground):
            return ""
        reference = np.zeros((CHI_DDOT + 1, ALPHA + len(self._stowed)))
        reference[CHI, ARM] = self._stowed
        wanted = np.array([*place, 0.0, math.nan, math.nan])
        try:
            HandPose(self._flyer, wanted).solved(reference, self._limits, self._ground)
        except PlanRefused as error:
            return str(error)
        return ""


class HandMarker:
    """The marker and its buttons; `later` passes a click to the thread that calls `look`."""

    def __init__(
        self,
        server: viser.ViserServer,
        view: VehicleView,
        commands: Commands,
        vehicle: VehicleDescription,
        later: Later,
    ) -> None:
        self._scene, self._view, self._commands = server.scene, view, commands
        self.reach = Reach(vehicle)
        self._marker: Any = None
        self._judged: tuple = ()  # the place that the text is about
        if not self.reach.has_hand:
            return
        with server.gui.add_folder("Hand", expand_by_default=False):
            place = server.gui.add_button("Marker at the hand", icon=viser.Icon.HAND_GRAB)
            self._text = server.gui.add_html(shown(["drag the marker, then go"]))
            self._go = server.gui.add_button("Go with the hand", icon=viser.Icon.MAP_PIN)
        self._go.disabled = True
        place.on_click(lambda _: later(self._put))
        self._go.on_click(lambda _: later(self._send))

    def look(self) -> None:
        """Say whether the marker's place can be reached; call it a few times a second."""
        self.reach.see(self._view.vehicle)
        place = () if self._marker is None else tuple(self._marker.position)
        if place == self._judged:
            return
        self._judged, why = place, self.reach.refusal(np.array(place))
        self._go.disabled = bool(why)
        where = ", ".join(f"{one:.2f}" for one in place)
        self._text.content = shown([f"{where} m", why or "within reach"])
        colour = BAD if why else GOOD
        self._scene.add_icosphere(f"{PATH}/ball", radius=BALL, color=colour)

    def _put(self) -> None:
        place = self._view.place(TOOL)
        if place is None:
            self._text.content = shown(["no hand is seen yet"])
            return
        self._marker = self._scene.add_transform_controls(
            PATH, scale=SIZE, disable_rotations=True, depth_test=False, position=tuple(place)
        )
        self._judged = ()

    def _send(self) -> None:
        if self._marker is not None:
            self._commands.bring_hand(np.array(self._marker.position)[POSITION])
