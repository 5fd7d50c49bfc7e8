"""Node: the laboratory of a rehearsal, one plant behind emulated devices on the wall clock.

The vehicle's nodes meet it on its devices alone: pseudo-terminals, sockets and a simulated GPIO
line. To ROS it publishes the truth for the report, and with `imu: topic` or `mocap: topic` this
sensor as a driver of its own. It reads the mission's status for the times of faults, and the steps
of the checklist, which its person does.
"""

import gc
import math
import sys
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from std_srvs.srv import Trigger

from uam_control.coordinates import ARM, CHI
from uam_control.mission.time_limit import FlightEnd
from uam_control.nodes.described import described_vehicle
from uam_control.settings.atomic import write_text
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import ImuWriter, PoseWriter
from uam_msgs_py.messages.status import ChecklistState, MissionStatus
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.answering import ServingExecutor
from uam_msgs_py.node.base_node import StopSignal, refuse, run_with
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.node_files import write_json
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_msgs_py.node.rightful import rightful_nodes
from uam_msgs_py.node.tunable import TunableNode
from uam_sim_bridge import hardware_priority
from uam_sim_bridge.devices.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.devices.mocap.calibration import load
from uam_sim_bridge.faults import CABLE, Schedule
from uam_sim_bridge.laboratory.laboratory import Laboratory
from uam_sim_bridge.laboratory.laboratory_parameters import TOPIC, LaboratoryParameters
from uam_sim_bridge.laboratory.person import Person
from uam_sim_bridge.nodes.fault_topic import FaultTopic
from uam_sim_bridge.nodes.plant_topics import TruthTopics
from uam_sim_bridge.paced_clock import PacedClock
from uam_sim_bridge.plant import Vehicle

IMU_DRIVER, POSE_DRIVER = "imu_driver", "pose_driver"
NAME = "laboratory"
READY = "ready"  # file in the folder of the devices, when they are there
# [ticks] between two messages of rotors, payload and magnet, and looks at topics; at services
LISTEN_TICKS, SERVE_TICKS = 5, 25
SWITCH = 0.0002  # [s] a thread of a device waits at most so long for the interpreter
CONFIRM = "confirm"  # a step that needs it
ASK_AGAIN = 2.0  # [s] between two confirmations of a step


class DriverTopic:
    """A node of its own that publishes one topic, as the driver of a sensor."""

    def __init__(self, node: Node, name: str, topic: Topic, writer: Any) -> None:
        """node: in whose namespace; writer: fills the message."""
        self._own = Node(name, namespace=node.get_namespace())
        self._publisher, self._writer = topic.outlet(self._own), writer

    def publish(self, sample: tuple | None, shift: float) -> None:
        """Publish a sample, time [s] of the plant first; shift [s]: from it to the system's."""
        if sample is not None:
            time, *values = sample
            self._publisher.publish(self._writer.fill(round((time + shift) * SECOND), *values))

    def close(self) -> None:
        self._own.destroy_node()


class Rehearsal:
    """Laboratory, its topics and its person, tick by tick."""

    def __init__(self, node: TunableNode, stop: StopSignal) -> None:
        """Raises ValueError, KeyError, OSError: bad parameters, or a port in use."""
        vehicle = described_vehicle(node)
        rightful_nodes(node)  # declares `publishers`, which every node of a flight has
        joints = vehicle.coordinates[ARM]
        p = NodeParameters(node, LaboratoryParameters, joints, read_only=True).current
        refuse_unknown(node)
        self._node, self._stop, self.parameters = node, stop, p
        numbers = Vehicle.of(vehicle).changed(p.changes())
        faults = Schedule.from_text(p.faults).only(CABLE)
        p.places.mkdir(parents=True, exist_ok=True)
        chain, cameras = load_chain(hardware_file(p.hardware), vehicle), load(p.calibration)
        self.lab = Laboratory(numbers, p, chain, cameras, faults)
        self._armed, self._ended_by, self._wall, self._priority = False, "", 0.0, 0
        self._changed = self.lab.pull_cables(0.0)  # faults at the start; published later
        self._fault_topic = FaultTopic(node) if faults else None
        self._truth = TruthTopics(node, vehicle)
        self._imu: DriverTopic | None = None
        if p.imu == TOPIC:
            writer = ImuWriter(frame(node, topics.BODY))
            self._imu = DriverTopic(node, IMU_DRIVER, topics.IMU, writer)
        self._poses: DriverTopic | None = None
        if p.poses == TOPIC:
            self._poses = DriverTopic(node, POSE_DRIVER, topics.MOCAP, PoseWriter())
        self._mission_topic = node.door.listen(topics.MISSION_STATUS)
        self._checklist = node.door.listen(topics.CHECKLIST)
        self._confirm = node.create_client(Trigger, "checklist/confirm")
        self._executor = ServingExecutor()
        self._executor.add_node(node)
        self.clock = PacedClock(self.lab.plant.period)
        self._mission = MissionStatus()
        self._person = Person(vehicle.joint_names, self.lab.folded)
        self._list, self._asked = ChecklistState(), -math.inf
        write_text(p.places / READY, f"{self.lab.mocap.port}\n")

    def await_autopilot(self) -> None:
        """Wait until the autopilot is connected, or a signal."""
        while not self._stop.raised and not self.lab.hil.accept(0.1):
            pass

    def run(self) -> None:
        """Run ticks until the mission is over, the limit of the flight, or a signal."""
        lab, clock = self.lab, self.clock
        gc.collect()
        gc.freeze()
        self._priority = hardware_priority.prefer()
        clock.begin()
        begin, end = time.monotonic(), FlightEnd(self.parameters.linger)
        limit, latest = self.parameters.flight_limit or math.inf, math.inf
        text = f"time limit of {limit:g} s after arming"
        while not self._stop.raised and not self._ended_by:
            clock.note(lab.plant.tick)
            host = clock.host(lab.plant.tick)
            self._tick(host)
            now = lab.plant.time
            if lab.hil.armed and not self._armed:
                self._armed, latest = True, now + limit
            armed, done = lab.hil.armed, self._mission.done
            self._ended_by = end.reason(now, armed, done, (latest, text))
        self._ended_by = self._ended_by or "interrupt"
        self._wall = time.monotonic() - begin

    def _tick(self, host: float) -> None:
        """Sense, publish, wait for the end of the tick, and step; host: system's time [s]."""
        lab, stamp = self.lab, round(host * SECOND)
        self._changed += lab.pull_cables(lab.plant.time)
        if self._changed and self._fault_topic:
            self._fault_topic.publish(stamp, self._changed)
            self._changed = []
        samples, truth = lab.sense(host)
        lab.send_hil(samples, truth)
        tick, shift = lab.plant.tick, host - lab.plant.time
        if self._imu is not None and lab.imu_plugged:
            self._imu.publish(samples.imu, shift)
        if self._poses is not None and lab.poses_come:
            self._poses.publish(samples.mocap, shift)
        if tick % LISTEN_TICKS:
            self._truth.publish_state(stamp, truth)
        else:
            self._truth.publish(stamp, truth, lab.hil.motors, lab.magnet)
            self._listen()
            self._be_the_person(truth.state[CHI])
        if tick % SERVE_TICKS == 0:
            self._executor.spin_once(0.0)
        if (left := self.clock.left(tick + 1)) > 0.0:
            time.sleep(left)
        if not lab.hil.connected:
            lab.hil.accept(0.0)
        lab.step(lab.receive_hil(), truth)

    def _listen(self) -> None:
        """Take the mission's status and the step of the checklist."""
        door = self._node.door
        for stamp, mission in door.decoded(self._mission_topic, MissionStatus.from_message):
            self._mission = mission
            shift = self.clock.host(0)
            self.lab.timeline.mission_at(
                stamp / SECOND - shift, self._mission.time, self._mission.phase
            )
        for _, state in door.decoded(self._checklist, ChecklistState.from_message):
            self._list = state

    def _be_the_person(self, chi: np.ndarray) -> None:
        if not self.parameters.person:
            return
        now = self.lab.plant.time
        self.lab.grip = self._person.update(now, self._list.step, chi)
        wishes = self._person.wishes_to_confirm and self._list.needs == CONFIRM
        if wishes and now - self._asked > ASK_AGAIN:
            self._asked = now
            if self._confirm.service_is_ready():
                self._confirm.call_async(Trigger.Request())

    def report(self) -> dict[str, object]:
        """Return the statistics so far, for JSON. lost_s: see PacedClock; steps: of the person."""
        lab, clock = self.lab, self.clock
        return {
            "ticks": lab.plant.tick,
            "wall_s": self._wall,
            "late_ticks": clock.late,
            "lost_s": round(clock.lost, 6),
            "armed": self._armed,
            "ended_by": self._ended_by,
            "fifo_priority": self._priority,
            "serial_bytes": lab.cable.carried,
            "bus_packets": lab.bus.line.instructions,
            "bus_packets_damaged": lab.bus.line.damaged,
            "mocap_frames": lab.mocap.sent,
            "steps": self._person.done,
        }

    def close(self) -> None:
        self.lab.close()
        self._executor.shutdown()
        for driver in (self._imu, self._poses):
            if driver is not None:
                driver.close()


def main() -> int:
    """Run the laboratory; return its exit status.

    0: the rehearsal is over or was asked to stop; 2: bad parameters, or a port in use, in one line.
    """
    stop = StopSignal()
    sys.setswitchinterval(SWITCH)
    return run_with(NAME, lambda node: _rehearse(node, stop), TunableNode)


def _rehearse(node: TunableNode, stop: StopSignal) -> int:
    try:
        rehearsal = Rehearsal(node, stop)
    except (ValueError, KeyError, OSError) as error:
        return refuse(NAME, error)
    try:
        rehearsal.await_autopilot()
        rehearsal.run()
        return 0
    finally:
        write_json(node, rehearsal.parameters.statistics, rehearsal.report())
        rehearsal.close()


if __name__ == "__main__":
    raise SystemExit(main())
