"""Base of the three controller nodes: joined inputs, parameters, adapted gains, services."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from uam_control.control.controllers import Controller
from uam_control.laws import catalogue
from uam_control.nodes.described import described_timing, described_vehicle
from uam_control.profiles.profile import default_profile, parameter_set
from uam_control.settings.parameter_set import ParameterError
from uam_control.stages.law_stages import LawStage
from uam_control.stages.tick_stamps import carried, serves
from uam_control.vehicle import derived_parameters
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import (
    NO_COMMAND,
    PositionCommand,
    Reference,
    read_position_command,
    read_reference,
    read_state,
)
from uam_msgs_py.messages.convert import JointStateWriter
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.node_names import WHOLE_BODY
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.answering import offer
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.joins import Ahead, StampJoin
from uam_msgs_py.node.node_parameters import NodeParameters, given
from uam_msgs_py.node.tick_times import DECODE, STAGE

RESET, FREEZE = "reset_adaptation", "freeze_adaptation"  # services


class ControllerNode(UamNode):
    """Node with one adaptive law; it runs once per stamp, after the last input of the stamp."""

    def __init__(
        self,
        name: str,
        controller: type[Controller],
        command: Topic,
        adaptation: Topic,
        last: Topic,
    ):
        """last: the topic whose message completes a tick; the reference arrives a tick ahead."""
        super().__init__(name)
        law = given(self).get("law", catalogue.DEFAULT)
        self.vehicle = described_vehicle(self)
        kind, axes = parameter_set(name, {"law": law}, self.vehicle)
        # for parameters that no parameter file gives
        defaults = default_profile(law, self.vehicle).section(name)
        derived = derived_parameters(self.vehicle).get(name)
        self.parameter_set = NodeParameters(self, kind, axes, defaults, derived)
        timing = described_timing(self, self.vehicle)
        self.controller = controller(self.parameter_set.current)
        self.stage = LawStage(self.controller, timing)
        self.parameter_set.apply = self.controller.set_parameters
        attitude = () if last is topics.STATE else (NO_COMMAND.attitude,)
        nothing = np.zeros((3, len(self.vehicle.coordinates)))
        self.spare = LawStage(controller(self.parameter_set.current), timing)
        for flying in (False, True):  # compiles the law: the first call takes a second
            self.spare.update(0, nothing, nothing, *attitude, flying)
        self._command, self._adaptation = self.publisher(command), self.publisher(adaptation)
        self._gains = JointStateWriter(self.controller.names)
        inputs = [topics.STATE, topics.REFERENCE]
        inputs += [] if last in inputs else [last]
        names, reference = [topic.name for topic in inputs], topics.REFERENCE.name
        ahead = Ahead(reference, partial(serves, period=timing.period), _later)
        self._join = StampJoin(names, self._joined, ahead=ahead)
        self.joins.append(self._join)
        self.triggers = (last.name,)
        joints = len(self.vehicle.joints)
        readers = {
            topics.STATE: lambda data: read_state(data, joints),
            topics.REFERENCE: lambda data: read_reference(data, joints),
            topics.POSITION_COMMAND: read_position_command,
        }
        for topic in inputs:
            self.listen(topic, partial(self._add, topic.name, readers[topic]))
        offer(self, Trigger, f"~/{RESET}", self.reset)
        offer(self, SetBool, f"~/{FREEZE}", self.freeze)

    def _add(self, name: str, read: Callable[[bytes], tuple], data: bytes) -> None:
        self._join.add(name, *read(data))

    def _joined(
        self,
        stamp: int,
        state: np.ndarray,
        reference: Reference,
        position: PositionCommand | None = None,
    ) -> None:
        begun = time.perf_counter()
        self.times.lap(DECODE)
        flying = reference.flying and (position is None or position.flying)
        attitude = () if position is None else (position.attitude,)
        wanted = self.reference_of(state, reference.values, flying)
        tau = self.stage.update(stamp, state, wanted, *attitude, flying)
        self.times.lap(STAGE)
        self.answer()
        self.send(stamp, tau, reference.values, flying)
        self.done_tick(stamp, begun)

    def answer(self) -> None:
        """Publish what the plant waits for, of the tick done last."""

    def send(self, stamp: int, tau: np.ndarray, reference: np.ndarray, flying: bool) -> None:
        """Publish the command of the tick `stamp` [ns], and the adapted gains if they are due.

        tau: see `update` of the controller; reference (3, 6 + n): of the mission.
        """
        self._command.publish(self.command(stamp, tau, reference, flying))
        if self.stage.gains_due:
            self._gains.position[:] = self.controller.adaptation
            self._adaptation.publish(self._gains.stamped(stamp))

    def reference_of(self, state: np.ndarray, reference: np.ndarray, flying: bool) -> np.ndarray:
        """Return the reference (3, 6 + n) of the law, from that of the mission."""
        return reference

    def command(self, stamp: int, tau: np.ndarray, reference: np.ndarray, flying: bool) -> bytes:
        """Return the message of a command; see `send`."""
        raise NotImplementedError

    def reset(self) -> tuple[bool, str]:
        """Set the adapted gains to their initial values; see `offer`."""
        controller = self.controller
        old = self._adapted()
        controller.reset_adaptation()
        new = self._adapted()
        changed = {name: (old[name], new[name]) for name in new if new[name] != old[name]}
        self.publish_change(ParameterChange(self.get_name(), RESET, changed))
        return True, f"adapted gains at their initial values: {_listed(new)}"

    def freeze(self, frozen: bool) -> tuple[bool, str]:
        """Set the parameter `adapt`, so that service and parameter always agree; see `offer`."""
        result = self.change_parameters([Parameter("adapt", value=not frozen)], FREEZE)
        how = "frozen at" if frozen else "free, from"
        done = f"adapted gains {how}: {_listed(self._adapted())}"
        return result.successful, result.reason or done

    def _adapted(self) -> dict[str, float]:
        return dict(zip(self.controller.names, self.controller.adaptation.tolist(), strict=True))

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        level, summary, values = super().diagnose()
        gains = {name: f"{value:.4g}" for name, value in self._adapted().items()}
        return level, summary, values | gains | {"saturated": self.controller.saturated}


def run_alone(kind: Callable[[], ControllerNode], name: str) -> int:
    """Run a controller in a process of its own, as `run`."""

    def make() -> ControllerNode:
        node = kind()
        if node.controller.law.whole:
            raise ParameterError(
                f"law: {node.controller.parameters.law} is one law of all three controllers: start "
                f"{WHOLE_BODY} in their place"
            )
        return node

    return run(make, name)


def _later(reference: Reference, step: int) -> Reference:
    """Return the reference `step` [ns] later."""
    return replace(reference, values=carried(reference.values, step))


def _listed(gains: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in gains.items())
