"""The plant as a ROS node: physics in place of vehicle, motion capture, IMU and Dynamixels.

For ROS it publishes sensors and truth, and subscribes to joint efforts and the magnet's switch. For
the autopilot it is a simulator with MAVLink over TCP. Two clocks, see docs/architecture.md:

lockstep  The plant also waits for a recorder that is far behind, so that no message is lost.
          By hand a wait has a limit in wall time; in `uam fly` none: it ends when no answer can
          come any more (`lockstep.py`).
          With the autopilot's IMU (`publish_imu: false`) the autopilot gets its sample first, and
          passes it on. Ticks before the first setpoint run at the pace of the wall clock.
          While a lost node is restarted, ticks run at the pace of the wall clock without its
          answers, until all answers have been in time for IN_TIME ticks.
realtime  After a stall of the machine ticks run a quarter faster (`paced_clock.py`). Without an
          answer by the next deadline the last command holds. The latency of a tick is the time from
          the publication of its IMU sample to that of its setpoint. Beyond one control period the
          tick counts as late (`plant_health.Statistics`).
          The bridge publishes /uam/setpoint after it has sent the setpoint to the autopilot.
"""

import gc
import math
import time
from functools import partial

from std_srvs.srv import Trigger

from uam_control.coordinates import ARM, POSITION
from uam_control.mission.time_limit import FlightEnd
from uam_control.nodes.described import described_vehicle
from uam_control.settings.process_parameters import TickTimesParameters
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.ros_time import nanoseconds as from_message
from uam_msgs_py.node import wiring
from uam_msgs_py.node.answering import offer
from uam_msgs_py.node.base_node import StopSignal, refuse, run_with
from uam_msgs_py.node.executor import LeanExecutor
from uam_msgs_py.node.node_files import write_json
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_msgs_py.node.rightful import rightful_nodes
from uam_msgs_py.node.tick_times import tick_times
from uam_msgs_py.node.tunable import TunableNode
from uam_msgs_py.node.wiring import Connections, connection_counts
from uam_sim_bridge.faults import PLANT, Schedule
from uam_sim_bridge.faults.faulty_plant import FaultyPlant, make_plant
from uam_sim_bridge.mavlink.hil.hil_server import WAITS, HilServer, open_only_here
from uam_sim_bridge.nodes.fault_topic import FaultTopic
from uam_sim_bridge.nodes.lockstep import Awaited, Lockstep, PlantStopped
from uam_sim_bridge.nodes.plant_health import PlantHealth, Statistics
from uam_sim_bridge.nodes.plant_options import NOT_READY, PlantParameters
from uam_sim_bridge.nodes.plant_topics import (
    Answers,
    RecorderProgress,
    Sensors,
    TruthTopics,
    nanoseconds,
)
from uam_sim_bridge.paced_clock import PacedClock, Patience
from uam_sim_bridge.plant import PhysicsError, Vehicle, warm_up
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.pose_effects import OdometryDrift

NAME = "mujoco_sim"
RESTART_PX4 = "; a PX4 does not connect again by itself: restart it"
CATCH_UP = 1.25  # [1] largest real-time factor after a stall of the machine
REPORT_INTERVAL = 5.0  # [s] between two log lines with the missing nodes
FOREIGN_WAIT = 1.0  # [s] for discovery by foreign nodes, which do not report their connections
SILENT = 10.0  # [s] longest wait for the motor commands of an autopilot that may be silent
LAST_WAIT = 3.0  # [s] longest wait for the recorder after the last tick
LATCHED_WAIT = 0.5  # [s] of wall time, in which a latched message arrives
AFTER_OTHERS = 1.0  # [s] the status of a mission is at most half a second older than its last tick
SERVICE_TICKS = 25  # [ticks] between two calls of the parameter services in real time


class NotReady(PlantStopped):
    """Not every node has started, or not all are connected."""


class Simulator:
    """Plant, topics and autopilot link, tick by tick."""

    def __init__(self, node: TunableNode, stop: StopSignal):
        """Raises ValueError, OSError: bad parameters, or a port in use."""
        described, rightful = described_vehicle(node), rightful_nodes(node)
        joints = described.coordinates[ARM]
        options = NodeParameters(node, PlantParameters, joints, read_only=True).current
        times = NodeParameters(node, TickTimesParameters, read_only=True).current
        refuse_unknown(node)
        self.node, self.options, self._stop = node, options, stop
        self._log = node.get_logger()
        named = presets.read(tuple(filter(None, options.plant_preset.split(","))))
        changes = presets.added({}, named) | options.changes()
        vehicle = Vehicle.of(described).changed(changes)
        start = (vehicle, options.payload_mass, options.seed, tuple(options.arm_start))
        faults = Schedule.from_text(options.faults).only(PLANT)
        self._make = partial(make_plant, *start, faults, options.plant)
        self.plant = self._make()
        self._faulty = self.plant if isinstance(self.plant, FaultyPlant) else None
        self._fault_topic = FaultTopic(node) if faults else None
        self._first_tick = 0
        self._reset_due = False
        offer(node, Trigger, "~/reset", self._on_reset)
        warm_up(make_plant(*start, Schedule(), options.plant))
        self._times = tick_times(times)
        self._odometry = OdometryDrift.NAME in vehicle.numbers["effects"]
        sensors = node, described, options.publish_imu, self._times, self._odometry
        self.sensors = Sensors(*sensors)
        self.truth = TruthTopics(node, described)
        servo_mode = vehicle.numbers["servos"]["mode"]
        self.answers = Answers(node, described, rightful, servo_mode)
        self.connections = Connections(node)
        self.recorded = RecorderProgress(node, rightful)
        last = [topics.SETPOINT.name]
        self.executor = LeanExecutor(node, last, lambda: self._lockstep.any_input_wakes)
        patience = self._limit = options.answer_timeout or math.inf  # [s] of a wait
        rotors = len(described.rotors)
        waits = min(patience, SILENT), WAITS[1]
        address = options.hil_address
        self.hil = HilServer(options.hil_port, rotors, address, waits, options.seed)
        if not open_only_here(address):
            self._log.warning(
                f"TCP port {options.hil_port} is open at {address}: every machine that reaches it "
                "can take the autopilot's place, without a password"
            )
        self.statistics = Statistics(options.clock, self.plant.period)
        self.health = PlantHealth(node, self.answers, self.statistics)
        pairs = [entry.partition("=") for entry in options.foreign.split(",") if entry]
        self._own_names = {node: name or node for node, _, name in pairs}
        self._foreign = tuple(self._own_names.values())
        self._complete = False  # every kind of sensor has delivered a sample
        self._stamp: int | None = None  # of this tick's IMU sample [ns]
        needed = wiring.reporting(options.recorded, self._own_names)
        self._awaited = Awaited(
            self.connections, needed, lambda whom: self.health.waiting(whom, self.plant.time)
        )
        period, heard = self.plant.period, (self.answers, self.recorded, self._awaited)
        self._lockstep = Lockstep(node, self.executor, options, stop, period, *heard)
        self._published = 0  # wall time [ns] of its publication
        self._begun = 0.0  # wall time [s] at which this tick began
        latest = options.let_go or math.inf
        self._clock = PacedClock(self.plant.period, catch_up=CATCH_UP, latest=latest)

    def wait_for_nodes(self) -> None:
        """Return when all nodes are connected to each other, and the autopilot to this node."""
        limit = self.options.start_timeout
        patience, missed = Patience(limit or math.inf), []
        reported, last = -math.inf, []
        while not self._stop.raised:
            self.executor.spin_once(0.05)
            waiting = self._waiting_for()
            if not waiting:
                break
            self.health.waiting(_listed(waiting))
            now = time.monotonic()
            if waiting != missed:  # progress: a slow machine gets the time again
                patience, missed = Patience(limit or math.inf), waiting
            if patience.over:
                raise NotReady(f"no progress for {limit:g} s, waiting for {_listed(waiting)}")
            if waiting != last and now - reported > 1.0 or now - reported > REPORT_INTERVAL:
                self._log.info(f"waiting for {_listed(waiting)}")
                reported, last = now, waiting
        settled = time.monotonic() + (FOREIGN_WAIT if self._foreign else 0.0)
        while time.monotonic() < settled and not self._stop.raised:
            self.executor.spin_once(0.05)
        self._log.info("all nodes are connected")
        if self.options.end_with_mission:
            self.answers.forget_mission()  # that of an earlier flight does not end this one
        else:
            self._begin_after(max(self.answers.mission_stamp, self._newest_report()))

    def _newest_report(self) -> int:
        """Return the stamp [ns] of the bridge's latched report, 0 without one."""
        topic, newest = topics.AUTOPILOT_STATE, 0
        reader = self.node.create_subscription(topic.type, topic.name, lambda _: None, topic.qos)
        end = time.monotonic() + LATCHED_WAIT
        while not newest and time.monotonic() < end:
            time.sleep(0.02)
            for message in self.node.door.messages(reader):
                newest = max(newest, from_message(message.header.stamp))
        self.node.door.forget(reader)
        self.node.destroy_subscription(reader)
        return newest

    def _begin_after(self, stamp: int) -> None:
        """Begin after `stamp` [ns] of an earlier simulation, so that stamps do not go back."""
        if stamp > 0:
            after = stamp / SECOND + AFTER_OTHERS
            self._first_tick = math.ceil(after / self.plant.period)
            self.plant.tick = self._first_tick
            self._log.info(f"the nodes are from an earlier simulation: begins at {after:.1f} s")

    def _on_reset(self) -> tuple[bool, str]:
        """Put the simulated world back to its start; time goes on."""
        if self.hil.armed:
            return False, "refused: the vehicle is armed"
        self._reset_due = True
        return True, "vehicle and payload at their start; time goes on"

    def _reset(self) -> None:
        """Make the plant anew at the present tick."""
        tick, self._reset_due = self.plant.tick, False
        self.plant = self._make()
        self.plant.tick = tick
        self._faulty = self.plant if isinstance(self.plant, FaultyPlant) else None

    def _waiting_for(self) -> list[str]:
        recorded, foreign = self.options.recorded, self._foreign
        wires = wiring.with_foreign(self.node, self._own_names)
        if not self.options.publish_imu:
            wires = wiring.with_autopilot_imu(wires)
        if self._odometry:
            wires = wiring.with_odometry(wires)
        waiting = wiring.missing(self.node, recorded, wires)
        if not waiting:  # all publishers and subscriptions exist: are they connected?
            outlets = self.sensors.outlets | self.truth.outlets
            plant = connection_counts(self.node, outlets, self.answers.inlets)
            waiting = list(
                wiring.unconnected(
                    self.connections,
                    plant,
                    recorded,
                    wires,
                    foreign,
                    self.node.get_namespace(),
                    wiring.publishers(self.node),
                )
            )
        if not self.hil.accept(0.0):
            waiting.append(f"autopilot to connect to TCP port {self.options.hil_port}")
        return waiting

    def run(self) -> None:
        """Run ticks until the mission is done, the time limit, or SIGINT."""
        realtime = self.options.clock == "realtime"
        limit = self.options.time_limit or math.inf
        at_limit = limit, f"time limit of {limit:g} s"
        gc.collect()
        gc.freeze()  # existing objects stay: later collections skip them
        begin, end = time.monotonic(), FlightEnd(self.options.linger)
        self._clock.begin()
        while not self._stop.raised:
            begun = time.perf_counter()
            if self._reset_due:
                self._reset()
            self._begin_tick()
            if realtime:
                self.hil.flush()
                self._wait_until(self._clock.deadline(self.plant.tick - self._first_tick + 1))
                self._measure()
                self._receive_hil(0.0)
            elif self.options.publish_imu:
                self._lockstep.wait(self._stamp, self._begun, self.plant.time)
                self.hil.flush()
                self._receive_hil()
            else:
                self.hil.flush()
                self._receive_hil()
                self._lockstep.wait(self._stamp, self._begun, self.plant.time)
            if self._faulty:
                stamp, mission = self.answers.mission_stamp * 1e-9, self.answers.mission
                self._faulty.timeline.mission_at(stamp, mission.time, mission.phase)
            if (fingers := self.answers.fingers) is not None and fingers.commanded:
                self.plant.open_to(fingers.opening)
            try:
                self.plant.step(self.hil.motors, self.answers.arm_command, self.answers.magnet)
            except PhysicsError as error:
                self.statistics.ended_by = str(error)
                break
            self.health.done_tick(begun, self.plant.time)
            ends = self.options.end_with_mission  # else by its limit alone
            armed, done = ends and self.hil.armed, ends and self.answers.mission.done
            self.statistics.ended_by = end.reason(self.plant.time, armed, done, at_limit)
            if self.statistics.ended_by:
                break
        else:
            self.statistics.ended_by = "interrupt"
        self.statistics.wall_s = time.monotonic() - begin
        last = LAST_WAIT if realtime else self._limit
        # unread messages are lost when the node ends
        self._lockstep.recorder_has_caught_up(0, last)

    def _begin_tick(self) -> None:
        """Publish the samples and the truth of this tick, and prepare those of the autopilot."""
        plant = self.plant
        self._begun = time.monotonic()
        self._clock.note(plant.tick - self._first_tick)
        now = self.node.stamp = nanoseconds(plant.time)
        self.answers.begin()
        samples = plant.sense()
        if self._faulty and self._faulty.changed:
            self._fault_topic.publish(now, self._faulty.changed)
        self.sensors.clock(now)  # first: the recorder stamps what has no stamp by it
        # Sensors with latency deliver no sample at first, and the estimator needs all sensors.
        # Earlier samples are not sent: how many of them it would receive is not reproducible.
        self._complete = self._complete or None not in (samples.imu, samples.joints, samples.mocap)
        self._published = time.time_ns()
        self._times.woken()
        self._stamp = self.sensors.publish(samples) if self._complete else None
        if self._stamp is not None:
            self._times.tick(self._stamp)
        # No node waits for what follows: it is done while the estimator works.
        truth = plant.truth()
        taken, gyro, force = samples.hil
        self.hil.prepare(taken, gyro, force, truth.state[0, POSITION], truth.quaternion)
        self.truth.publish(now, truth, self.hil.motors, self.answers.magnet)

    def _receive_hil(self, timeout: float | None = None) -> None:
        """Receive the autopilot's motor commands; timeout [s], None: see HilServer.receive."""
        patience = timeout
        if timeout is None and self.options.autopilot_always_answers:
            patience = self._limit
        self._awaited.begin()

        def going_on() -> bool:
            self._awaited.told(lambda: "motor commands of the autopilot")
            return not self._stop.raised

        self.hil.receive(patience, going_on)
        if self._stop.raised:
            return
        if not self.hil.connected and not self.options.end_with_mission:
            self._await_autopilot()
            return
        if not self.hil.connected:
            raise PlantStopped(f"the autopilot closed the link at t = {self.plant.time:.3f} s")
        required = self.options.autopilot_always_answers and timeout is None
        if required and not self.hil.answered:
            raise PlantStopped(
                f"no motor commands for t = {self.plant.time:.3f} s within "
                f"{self.options.answer_timeout:g} s; the autopilot is silent"
            )

    def _await_autopilot(self) -> None:
        """Wait for the autopilot to connect again; time stands still, services are served."""
        again = "" if self.options.autopilot_always_answers else RESTART_PX4
        self._log.warning(f"waiting for the autopilot on TCP port {self.options.hil_port}{again}")
        while not self._stop.raised and not self.hil.accept(0.0):
            self.executor.spin_once(0.05)

    def _wait_until(self, deadline: float) -> None:
        left = deadline - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        self.answers.take()
        # now that the setpoint is taken: the executor would discard its source time
        if self.plant.tick % SERVICE_TICKS == 0:
            self.executor.spin_once(0.0)

    def _measure(self) -> None:
        """Measure the latency of this tick, and of ticks whose setpoints have arrived."""
        stamp = self._stamp if self.options.publish_imu else self.node.stamp
        self.statistics.tick(stamp, self._published, self.answers.setpoints)
        self.answers.setpoints.clear()

    def report(self) -> Statistics:
        """Return the statistics so far; unanswered ticks count once their deadline is over."""
        numbers = self.statistics
        numbers.ticks, numbers.simulated_s = self.plant.tick, self.plant.time
        numbers.conclude(self._published)
        numbers.late_motor_commands = self.hil.missed
        return numbers

    def close(self) -> None:
        self._times.close()
        self.hil.close()
        self.executor.shutdown()


def _listed(waiting: list[str]) -> str:
    """Return the first four as a text, with the number of the others."""
    shown = "; ".join(waiting[:4])
    return shown if len(waiting) <= 4 else f"{shown}; and {len(waiting) - 4} more"


def main() -> int:
    """Run the plant; return its exit status.

    0: the mission ended or the node was asked to stop; 1: the flight could not go on; 2: bad
    parameters, or a port in use. Each in one line.
    """
    stop = StopSignal()
    # The context must outlive the signal, as there are statistics to write and links to close.
    return run_with(NAME, lambda node: _simulate(node, stop), TunableNode)


def _simulate(node: TunableNode, stop: StopSignal) -> int:
    try:
        simulator = Simulator(node, stop)
    except (ValueError, OSError) as error:
        return refuse(NAME, error)
    try:
        simulator.wait_for_nodes()
        simulator.run()
        return 0
    except PlantStopped as error:
        node.get_logger().fatal(str(error))
        simulator.statistics.ended_by = str(error)
        return NOT_READY if isinstance(error, NotReady) else 1
    finally:
        simulator.close()
        write_json(node, simulator.options.statistics, simulator.report().to_mapping())


if __name__ == "__main__":
    raise SystemExit(main())
