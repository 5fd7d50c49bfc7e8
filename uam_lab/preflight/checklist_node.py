"""Node: the checklist before a flight of a real vehicle, see docs/preflight.md.

It reads the vehicle, asks a person for motions, and publishes the result on /uam/checklist. The
mission starts with `require_checklist` only when all items have passed.
"""

import time
from pathlib import Path

import numpy as np
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from uam_control.nodes.described import described_vehicle
from uam_control.settings.preflight_check import GUIDED
from uam_control.stamps import SECOND
from uam_control.vehicle import VehicleDescription
from uam_lab.cockpit.services import Services
from uam_lab.flights.vehicle.checklist_parameters import ChecklistOptions, ChecklistParameters
from uam_lab.preflight.checklist.automatic import automatic
from uam_lab.preflight.checklist.checklist import Checklist, record
from uam_lab.preflight.checklist.guided import guided
from uam_lab.preflight.checklist.host import HostReader
from uam_lab.preflight.checklist.observation import Box, Observation
from uam_lab.preflight.checklist.step import Step, StepState
from uam_lab.preflight.checklist_feed import Feed
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import checklist_message
from uam_msgs_py.messages.status import ERROR, OK, WARN, ChecklistState, diagnostic
from uam_msgs_py.node import wiring
from uam_msgs_py.node.answering import ServingExecutor, offer
from uam_msgs_py.node.base_node import StopSignal, run_with
from uam_msgs_py.node.namespace import label
from uam_msgs_py.node.node_files import write_json
from uam_msgs_py.node.node_parameters import NodeParameters, plain, refuse_unknown
from uam_msgs_py.node.rightful import rightful_nodes

NAME = wiring.CHECKLIST
POLL_PERIOD = 0.02  # [s]
PUBLISH_PERIOD = 0.2  # [s] wall time
FENCE_PERIOD = 1.0  # [s] wall time between two requests of the geofence
FENCE = ("geofence_low", "geofence_high")  # parameters of the mission
CORE = (
    *(wiring.RECORDER, wiring.ESTIMATOR, wiring.MISSION),
    *(wiring.POSITION, wiring.ATTITUDE, wiring.ARM, wiring.BRIDGE),
)


class ChecklistNode:
    """Joins the feed, the checklist, and what other nodes do for its steps."""

    def __init__(
        self,
        node: Node,
        watcher: Node,
        vehicle: VehicleDescription,
        options: ChecklistOptions,
        limits: NodeParameters[ChecklistParameters],
    ) -> None:
        """watcher: a node that is not spun, for the polled topics."""
        self._node, self._limits = node, limits
        self._checklist = Checklist(guided(vehicle.joint_names, limits.current, options.magnet))
        limits.apply = self._set_limits
        self._vehicle, self._options = vehicle, options
        observation = Observation(
            expected=tuple(one for one in options.nodes.split(",") if one) or CORE,
            joint_names=vehicle.joint_names,
            stowed=np.array(vehicle.stowed),
            control_rate=1.0 / vehicle.control_period,
            gravity=float(vehicle.numbers["gravity"]),
            room=Box(options.room_low, options.room_high) if options.room_low else None,
        )
        host = HostReader(Path(options.recordings))
        self._feed = Feed(
            watcher, rightful_nodes(node), vehicle, observation, host, lambda: limits.current
        )
        self._services = Services(node)
        self._publisher = topics.CHECKLIST.outlet(node)
        self._diagnostics = topics.DIAGNOSTICS.outlet(node)
        offer(node, Trigger, "~/confirm", self._checklist.confirm)
        offer(node, Trigger, "~/repeat", self._checklist.repeat)
        self._due = self._diagnostics_due = self._fence_due = 0.0
        self._published: ChecklistState | None = None
        self._begun: tuple[str, int] = ("", 0)  # name and try of the step that was acted for
        self._released = False  # the arm
        self._recorded = 0  # number of entries in the file

    def _set_limits(self, limits: ChecklistParameters) -> None:
        """Use new limits: the guided steps begin anew with them."""
        self._checklist.steps[:] = guided(self._vehicle.joint_names, limits, self._options.magnet)

    def look(self) -> None:
        """Take new messages, judge, publish."""
        now, wall = self._feed.look(), time.monotonic()
        seen = self._feed.observation
        if not seen.armed and wall >= self._fence_due:
            self._fence_due = wall + FENCE_PERIOD
            self._ask_fence()
        before = len(self._checklist.entries)
        self._checklist.update(now, automatic(seen, self._limits.current), seen.armed)
        for entry in self._checklist.entries[before:]:
            if entry["kind"] == GUIDED:
                text = f"{entry['name']} {entry['state']}: {entry['value']}"
                self._node.get_logger().info(text)
        self._act(self._checklist.step)
        self._services.look()
        self._record()  # before a reader hears of it
        self._publish(wall)

    def _act(self, step: Step | None) -> None:
        """Switch the magnet and release the arm as the step needs it."""
        released = step is not None and step.arm_released
        if released != self._released:
            self._released = released
            if not released:  # the law has adapted to an arm that did not obey
                self._call(Trigger, "arm_controller/reset_adaptation", Trigger.Request())
            self._call(SetBool, "arm_driver/release", SetBool.Request(data=released))
        begun = ("", 0) if step is None else (step.name, step.tries)
        if begun != self._begun:
            self._begun = begun
            if step is not None and step.magnet is not None:
                self._call(SetBool, "mission/magnet", SetBool.Request(data=step.magnet))

    def _call(self, kind: type, service: str, request: SetBool.Request | Trigger.Request) -> None:
        """Call a service of a step; a failure is logged. A vehicle may lack the node."""

        def answered(response: SetBool.Response | Trigger.Response | None, why: str) -> None:
            if response is None or not response.success:
                self._node.get_logger().warning(f"{service}: {why or response.message}")

        self._services.call(kind, service, request, answered)

    def _ask_fence(self) -> None:
        def answered(response: GetParameters.Response | None, why: str) -> None:
            if response is not None and len(response.values) == len(FENCE):
                self._feed.observation.fence = Box(*(plain(one) for one in response.values))

        service = f"{wiring.MISSION}/get_parameters"
        if self._services.ready(GetParameters, service):
            request = GetParameters.Request(names=list(FENCE))
            self._services.call(GetParameters, service, request, answered)

    @property
    def state(self) -> ChecklistState:
        checklist = self._checklist
        step = checklist.step
        failing = "; ".join(checklist.failing_names)
        if step is None:
            return ChecklistState(checklist.passed, failing)
        seen = step.seen if step.state is StepState.ACTIVE else f"{step.value}; now: {step.seen}"
        return ChecklistState(
            checklist.passed,
            failing,
            step.name,
            step.needs,
            step.instruction,
            seen,
            step.state is StepState.FAILED,
            step.commands,
        )

    def _publish(self, wall: float) -> None:
        """Publish on a change of the step or of the permission, and each PUBLISH_PERIOD."""
        state = self.state
        last = self._published
        same = last is not None and (state.passed, state.step, state.needs, state.failed) == (
            last.passed, last.step, last.needs, last.failed,
        )  # fmt: skip
        if same and wall < self._due:
            return
        self._due, self._published = wall + PUBLISH_PERIOD, state
        stamp = round(self._feed.now * SECOND)
        self._publisher.publish(checklist_message(stamp, state, self._checklist.items))
        if wall >= self._diagnostics_due:
            self._diagnostics_due = wall + 1.0
            door = self._feed.door
            values = {"step": state.step, "failing": state.failing, **door.values()}
            level, summary = OK if state.passed else WARN, state.summary
            if new := door.news():
                level, summary = ERROR, "; ".join(new)
                self._node.get_logger().error(summary)
            self._diagnostics.publish(diagnostic(stamp, label(self._node), level, summary, values))

    def _record(self) -> None:
        file, count = self._options.record, len(self._checklist.entries)
        if not file or count == self._recorded:
            return
        self._recorded = count
        content = record(self._checklist, self._limits.current, time.time() - self._feed.now)
        write_json(self._node, file, content)


def main() -> int:
    """Run the checklist until SIGINT or SIGTERM; return the exit status."""
    stop = StopSignal()
    status = run_with(NAME, lambda node: _check(node, stop))
    stop.ignore()
    return status


def _check(node: Node, stop: StopSignal) -> int:
    options = NodeParameters(node, ChecklistOptions, read_only=True).current
    limits = NodeParameters(node, ChecklistParameters)
    vehicle = described_vehicle(node)
    watcher = Node(f"{NAME}_watch", start_parameter_services=False, enable_rosout=False)
    checklist = ChecklistNode(node, watcher, vehicle, options, limits)
    refuse_unknown(node)
    executor = ServingExecutor()
    executor.add_node(node)
    while not stop.raised:
        end = time.monotonic() + POLL_PERIOD
        checklist.look()
        while (left := end - time.monotonic()) > 0.0 and not stop.raised:
            executor.spin_once(timeout_sec=left)
    watcher.destroy_node()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
