"""The plant as a ROS node: physics in place of vehicle, motion capture, IMU and Dynamixels.

Towards ROS it publishes sensors and truth and takes joint efforts and the magnet's switch; towards
the autopilot it is a simulator that speaks MAVLink over TCP. Two clocks:

lockstep  At every control tick the plant waits for the setpoint that the bridge sent for this
          tick's IMU sample, for joint efforts and magnet, and for the autopilot's motor commands.
          Every wait is bounded in wall time; when one ends, the node says who did not answer.
realtime  Ticks begin at absolute deadlines of the wall clock, `control period` apart. What has not
          arrived by the next deadline is missing, and what was commanded last holds. A control tick
          counts as missed when no new setpoint arrived during it, so that the autopilot went on
          with an old one. The latency of a tick is the time from the publication of its IMU sample
          to that of its setpoint; a tick whose latency exceeds the control period counts as late.
          The bridge publishes /uam/setpoint when it has sent the setpoint to the autopilot, which
          therefore has it by then.
"""

from __future__ import annotations

import gc
import json
import math
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from uam_control.coordinates import POSITION
from uam_control.parameters import ParameterError
from uam_msgs_py.executor import LeanExecutor
from uam_msgs_py.node import StopSignal, refuse
from uam_msgs_py.parameters import refuse_unknown
from uam_sim_bridge.flight import wiring
from uam_sim_bridge.mavlink.hil_server import HilParameters, HilServer
from uam_sim_bridge.nodes.plant_topics import SUSPECTS, Answers, Sensors, TruthTopics, nanoseconds
from uam_sim_bridge.plant import Plant, Samples, Truth, Vehicle

NAME = "mujoco_sim"
SETTLE = 0.5  # [s] after discovery is complete here, for it to complete everywhere
REPORT_INTERVAL = 5.0  # [s] between two lines that say who is waited for
SERVICE_TICKS = 25  # in real time the parameter services are looked after every so many ticks


class PlantStopped(RuntimeError):
    """The flight cannot go on; the text is one line and says who did not answer."""


@dataclass(frozen=True)
class Options:
    """The node's parameters."""

    vehicle: str = "s500_arm"
    vehicle_changes: str = "{}"
    payload_mass: float = 0.2
    seed: int = 1
    arm_start: list[float] = field(default_factory=lambda: [0.0, math.pi / 2.0])
    clock: str = "lockstep"
    hil_port: int = 4560
    autopilot_always_answers: bool = True
    recorded: bool = False
    start_timeout: float = 0.0
    answer_timeout: float = 10.0
    time_limit: float = 0.0
    statistics: str = ""


DESCRIPTIONS = {
    "vehicle": "name of a file in config/vehicle",
    "vehicle_changes": 'JSON, dotted entries of that file to replace, as {"air.gust": 1.0}',
    "payload_mass": "mass of the payload [kg], 0 for none",
    "seed": "of all noise",
    "arm_start": "joint angles on the ground [rad]",
    "clock": "lockstep or realtime",
    "hil_port": "TCP port at which the autopilot connects",
    "autopilot_always_answers": "the stand-in does; PX4 is silent while it boots",
    "recorded": "wait for the recorder as well",
    "start_timeout": "longest wait for the other nodes [s], 0 = for ever",
    "answer_timeout": "longest wait for the answers to a tick [s of wall time]",
    "time_limit": "simulation time at which the flight ends in any case [s], 0 = never",
    "statistics": "JSON file to write at the end, empty = none",
}


def declare(node: Node) -> Options:
    """Declare the parameters and return their values. Raises ParameterError for a bad one."""
    values = {}
    for name, default in asdict(Options()).items():
        text = ParameterDescriptor(description=DESCRIPTIONS[name], read_only=True)
        values[name] = node.declare_parameter(name, default, text).value
    options = Options(**values)
    if options.clock not in ("lockstep", "realtime"):
        raise ParameterError(f"clock: '{options.clock}' is not lockstep or realtime")
    return options


@dataclass
class Statistics:
    """What the node reports at the end."""

    clock: str
    ticks: int = 0
    simulated_s: float = 0.0
    wall_s: float = 0.0
    answerable_ticks: int = 0  # realtime: ticks with an IMU sample, which hence want a setpoint
    missed_ticks: int = 0
    late_ticks: int = 0
    late_motor_commands: int = 0
    latency_s: list[float] = field(default_factory=list)
    ended_by: str = ""


class Simulator:
    """Plant, topics and autopilot link, tick by tick."""

    def __init__(self, node: Node, options: Options, stop: StopSignal):
        self.node, self.options, self._stop = node, options, stop
        vehicle = Vehicle.load(options.vehicle).changed(json.loads(options.vehicle_changes))
        self.plant = Plant(vehicle, options.payload_mass, options.seed, tuple(options.arm_start))
        self.sensors, self.truth = Sensors(node), TruthTopics(node)
        self.answers = Answers(node)
        self.executor = LeanExecutor(node)
        patience = options.answer_timeout
        waits = HilParameters(answer_timeout=patience)
        if options.autopilot_always_answers:
            waits = HilParameters(answer_timeout=patience, silent_timeout=patience)
        self.hil = HilServer(options.hil_port, parameters=waits, seed=options.seed)
        self.statistics = Statistics(options.clock)
        self._complete = False  # every kind of sensor has delivered
        self._stamp: int | None = None  # of this tick's IMU sample [ns]
        self._published = 0  # wall time [ns] of its publication
        self._unanswered: dict[int, int] = {}  # stamp [ns] → wall time of publication [ns]

    def wait_for_everyone(self) -> None:
        """Return when all nodes are connected to each other and the autopilot to us."""
        limit = self.options.start_timeout
        begin, reported, last = time.monotonic(), -math.inf, []
        while not self._stop.raised:
            self.executor.spin_once(0.05)
            waiting = wiring.missing(self.node, self.options.recorded)
            if not self.hil.accept(0.0):
                waiting.append(f"autopilot to connect to TCP port {self.options.hil_port}")
            if not waiting:
                break
            now = time.monotonic()
            if limit and now - begin > limit:
                raise PlantStopped(f"not ready after {limit:g} s, waiting for {_listed(waiting)}")
            if waiting != last and now - reported > 1.0 or now - reported > REPORT_INTERVAL:
                print(f"mujoco_sim: waiting for {_listed(waiting)}", flush=True)
                reported, last = now, waiting
        settled = time.monotonic() + SETTLE
        while not self._stop.raised and time.monotonic() < settled:
            self.executor.spin_once(0.05)
        print("mujoco_sim: everyone is there", flush=True)

    def run(self) -> None:
        """Fly until the mission is done, the time limit, or SIGINT."""
        realtime = self.options.clock == "realtime"
        limit = self.options.time_limit or math.inf
        period = self.plant.period
        gc.collect()
        gc.freeze()  # what exists now stays; later collections need not look at it
        begin = time.monotonic()
        while not self._stop.raised:
            samples, truth = self._begin_tick()
            if realtime:
                self._send_hil(samples, truth)
                self._wait_until(begin + (self.plant.tick + 1) * period)
                self._measure()
                self._receive_hil(0.0)
            else:
                self._wait_for_answers()
                self._send_hil(samples, truth)
                self._receive_hil()
            self.plant.step(self.hil.motors, self.answers.effort, self.answers.magnet)
            if self.answers.mission.done:
                self.statistics.ended_by = "mission"
                break
            if self.plant.time >= limit:
                self.statistics.ended_by = f"time limit of {limit:g} s"
                break
        else:
            self.statistics.ended_by = "interrupt"
        self.statistics.wall_s = time.monotonic() - begin

    def _begin_tick(self) -> tuple[Samples, Truth]:
        """Publish what is due at this tick."""
        plant = self.plant
        now = nanoseconds(plant.time)
        self.answers.begin()
        samples, truth = plant.sense(), plant.truth()
        self.sensors.clock(now)
        # Sensors with latency deliver nothing at first. The estimator cannot begin before all have,
        # and which of the early samples it would have seen by then is chance: they are not sent.
        self._complete = self._complete or None not in (samples.imu, samples.joints, samples.mocap)
        self._published = time.time_ns()
        self._stamp = self.sensors.publish(samples) if self._complete else None
        # Nobody waits for the truth: it goes out while the estimator works.
        self.truth.publish(now, truth, self.hil.motors, self.answers.magnet)
        return samples, truth

    def _send_hil(self, samples: Samples, truth: Truth) -> None:
        """Give the autopilot its sensors."""
        now, gyro, force = samples.hil
        self.hil.send(now, gyro, force, truth.state[0, POSITION], truth.quaternion)

    def _receive_hil(self, timeout: float | None = None) -> None:
        """Take the autopilot's motor commands; timeout [s], None: see HilServer.receive."""
        self.hil.receive(timeout)
        if not self.hil.connected:
            raise PlantStopped(f"the autopilot hung up at t = {self.plant.time:.3f} s")
        required = self.options.autopilot_always_answers and timeout is None
        if required and not self.hil.answered:
            raise PlantStopped(
                f"no motor commands for t = {self.plant.time:.3f} s within "
                f"{self.options.answer_timeout:g} s; the autopilot is silent"
            )

    def _wait_for_answers(self) -> None:
        if self._stamp is None:
            return
        deadline = time.monotonic() + self.options.answer_timeout
        while missing := self.answers.missing(self._stamp):
            self.executor.spin_once(0.1)
            if self._stop.raised:
                return
            if time.monotonic() > deadline:
                raise PlantStopped(self._no_answer(missing))

    def _no_answer(self, missing: frozenset[str]) -> str:
        suspect = SUSPECTS.get(missing)
        return (
            f"no {' and no '.join(sorted(missing))} for t = {self.plant.time:.3f} s within "
            f"{self.options.answer_timeout:g} s" + (f"; {suspect} is silent" if suspect else "")
        )

    def _wait_until(self, deadline: float) -> None:
        if self.plant.tick % SERVICE_TICKS == 0:
            self.answers.take()  # first, so that none of them goes the way without a time
            self.executor.spin_once(0.0)
        left = deadline - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        self.answers.take()

    def _measure(self) -> None:
        """Note what became of this tick, and the latencies of the setpoints that have arrived."""
        numbers = self.statistics
        if self._stamp is not None:
            self._unanswered[self._stamp] = self._published
            numbers.answerable_ticks += 1
            numbers.missed_ticks += not self.answers.setpoints
        for answered, sent in self.answers.setpoints.items():
            begun = self._unanswered.pop(answered, None)
            if begun is None:
                continue
            latency = (sent - begun) * 1e-9
            numbers.latency_s.append(latency)
            numbers.late_ticks += latency > self.plant.period
        self.answers.setpoints.clear()

    def report(self) -> Statistics:
        """The statistics so far; ticks that were never answered are late ones, except the last."""
        numbers = self.statistics
        numbers.ticks, numbers.simulated_s = self.plant.tick, self.plant.time
        self._unanswered.pop(self._stamp, None)
        numbers.late_ticks += len(self._unanswered)
        numbers.late_motor_commands = self.hil.missed
        self._unanswered.clear()
        return numbers

    def close(self) -> None:
        """End the link to the autopilot."""
        self.hil.close()
        self.executor.shutdown()


def _listed(waiting: list[str]) -> str:
    """The first few of many, and how many more."""
    shown = "; ".join(waiting[:4])
    return shown if len(waiting) <= 4 else f"{shown}; and {len(waiting) - 4} more"


def main() -> int:
    """Run the plant; return its exit status.

    0: the mission ended or the node was asked to stop; 1: the flight could not go on; 2: bad
    parameters, or a port in use. Each in one line.
    """
    stop = StopSignal()
    # The context must outlive the signal, as there are statistics to write and links to close.
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = Node(NAME)
    simulator = None
    try:
        options = declare(node)
        refuse_unknown(node)
        try:
            simulator = Simulator(node, options, stop)
        except (ValueError, KeyError, OSError) as error:
            return refuse(NAME, error)
        try:
            simulator.wait_for_everyone()
            simulator.run()
        except PlantStopped as error:
            print(f"{NAME}: {error}", file=sys.stderr, flush=True)
            simulator.statistics.ended_by = str(error)
            return 1
        return 0
    except ParameterError as error:
        return refuse(NAME, error)
    finally:
        if simulator is not None:
            simulator.close()
            if options.statistics:
                Path(options.statistics).write_text(json.dumps(asdict(simulator.report())))
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    raise SystemExit(main())
