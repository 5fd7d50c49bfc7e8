"""The commands of the page: what each calls, and whether the flight's state allows it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from std_srvs.srv import SetBool, Trigger

from uam_control.profiles.profile import CONTROLLERS
from uam_control.supervision import Event, OperatorCommand, State
from uam_control.supervision.states import AIRBORNE_STATES, TARGETS
from uam_lab.cockpit.services import Services
from uam_lab.cockpit.vehicle_health import Health
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.navigation import goal_message

Later = Callable[[Callable[[], None]], None]
Said = Callable[[bool, str], None]
MAGNET = "mission/magnet"
STATES = {state.value: state for state in State}
GOAL = "x, y, z [m], heading [°]"


@dataclass(frozen=True)
class Button:
    """A command and its services."""

    label: str
    icon: str
    services: tuple[str, ...]
    hint: str
    on: bool | None = None  # value of a SetBool request, None for a Trigger
    ask: str = ""  # question to confirm first, "" for none
    in_flight: str = ""  # the same, in the air only
    colour: str | None = None
    events: tuple[Event, ...] = ()  # of the supervisor, of which one must be possible, () without
    calls: int = 1  # of each service; kill counts at the second


def _each(service: str) -> tuple[str, ...]:
    return tuple(f"{name}/{service}" for name in CONTROLLERS)


START = Button("Start", "PLANE_DEPARTURE", ("mission/start",), "arm and take off, if the pre-arm "
               "report is green", colour="green", events=(Event.READY,))  # fmt: skip
DISARM = Button("Disarm", "POWER", ("mission/disarm",), "motors off", colour="red",
                ask="Motors off: a vehicle in the air falls. Disarm?",
                events=(OperatorCommand.DISARM.value, Event.DISARM_ON_GROUND))  # fmt: skip
BUTTONS = (
    START,
    Button("Hold", "PLAYER_PAUSE", ("mission/hold",), "stop here and stay",
           events=(OperatorCommand.HOLD.value,)),
    Button("Resume", "PLAYER_PLAY", ("mission/resume",), "continue the scenario",
           events=(OperatorCommand.RESUME.value, Event.REGAINED)),
    Button("Land", "ARROW_BAR_TO_DOWN", ("mission/land",), "land here", colour="orange",
           events=(OperatorCommand.LAND.value,)),
    DISARM,
    Button("Kill", "SKULL", ("mission/kill",), "motors off at once, in every state", colour="red",
           ask="The motors stop at once; a vehicle in the air falls. Kill?", calls=2),
    Button("Magnet on", "MAGNET", (MAGNET,), "until the scenario switches it", on=True),
    Button("Magnet off", "MAGNET_OFF", (MAGNET,), "drops the payload", on=False,
           in_flight="A payload that hangs at the magnet falls. Magnet off?"),
    Button("Freeze adaptation", "SNOWFLAKE", _each("freeze_adaptation"),
           "adapted gains stay constant", on=True),
    Button("Free adaptation", "SNOWFLAKE_OFF", _each("freeze_adaptation"),
           "adapted gains adapt again", on=False),
    Button("Reset adaptation", "REFRESH", _each("reset_adaptation"),
           "adapted gains back to their initial values"),
)  # fmt: skip


def refusal(button: Button, health: Health) -> str:
    """Return why a command is not possible in the present state, "" if it may be.

    The mission decides; this only keeps a button from offering what it would refuse.
    """
    mission, autopilot = health.mission, health.autopilot
    state = None if mission is None else STATES.get(mission.state)
    if state is None:
        return ""
    failed = [check.name for check in health.preflight if not check.passed]
    if button is START and mission.done:
        state = State.GROUNDED  # it begins the next flight
    if button.events and not any((state, event) in TARGETS for event in button.events):
        return f"not while {state.value}"
    if button is START and failed:
        return f"pre-arm report: {', '.join(failed)}"
    if button is DISARM and state in AIRBORNE_STATES and not (autopilot and autopilot.landed):
        return f"{state.value} and not on the ground: land first"
    if button.services == (MAGNET,) and state is State.DISARMED:
        return "not while disarmed"
    if button.services == (MAGNET,) and mission.magnet is button.on:
        return f"it is {'on' if button.on else 'off'}"
    return ""


def question(button: Button, health: Health) -> str:
    """Return what to confirm before the command, "" for nothing."""
    mission = health.mission
    grounded = mission is not None and mission.state in (State.GROUNDED.value, State.DISARMED.value)
    return button.ask or ("" if grounded else button.in_flight)


class Commands:
    """Calls the services of the buttons and sends goals; said: gets the answers."""

    def __init__(self, services: Services, health: Health, said: Said) -> None:
        self._services, self._health, self._said = services, health, said

    def refusal(self, button: Button) -> str:
        """Return why the command is not possible now, "" if it may be."""
        kind = _kind(button)
        if not any(self._services.ready(kind, name) for name in button.services):
            return "no node offers it"
        return refusal(button, self._health)

    def question(self, button: Button) -> str:
        """Return what to confirm before the command now, "" for nothing."""
        return question(button, self._health)

    def call(self, button: Button) -> None:
        kind = _kind(button)
        request = Trigger.Request() if button.on is None else SetBool.Request(data=button.on)
        for name in button.services:
            if self._services.ready(kind, name):
                self._services.call(kind, name, request, self._answer(button, name, button.calls))

    def _answer(self, button: Button, name: str, calls: int) -> Callable[[Any, str], None]:
        def answered(response: Trigger.Response | SetBool.Response | None, why: str) -> None:
            if calls > 1 and not why:
                again = self._answer(button, name, calls - 1)
                self._services.call(Trigger, name, Trigger.Request(), again)
                return
            done = response is not None and response.success
            said = why or response.message or ("done" if done else "refused")
            node = name.strip("/").partition("/")[0]
            self._said(done, f"{button.label}: {node}: {said}")

        return answered

    def goto(self, text: str) -> None:
        """Send a goal, typed as GOAL; the mission's answer comes with its status."""
        try:
            goal = goal_of(text)
        except ValueError as error:
            self._said(False, f"Go to: {error}")
            return
        self._services.publish(topics.GOAL_POSE, goal)

    def bring_hand(self, place: np.ndarray) -> None:
        """Send a goal of the hand, place (3,) [m]; its heading stays."""
        self._services.publish(topics.END_EFFECTOR_GOAL, goal_message(place))


def goal_of(text: str) -> PoseStamped:
    """Return the goal of a typed GOAL: without height 0 (kept), without heading the present one.

    Raises ValueError.
    """
    parts = text.replace(",", " ").split()
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3, 4) or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{text.strip() or 'nothing'}: {GOAL} expected, as 0.5, 0, 1.2, 90")
    x, y, z, *yaw = [*numbers, 0.0][: max(3, len(numbers))]
    return goal_message((x, y, z), *map(math.radians, yaw))


def _kind(button: Button) -> type:
    return Trigger if button.on is None else SetBool
