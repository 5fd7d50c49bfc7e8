"""The plant as a ROS node: physics in place of vehicle, motion capture, IMU and Dynamixels.

Towards ROS it publishes sensors and truth and takes joint efforts and the magnet's switch; towards
the autopilot it is a simulator that speaks MAVLink over TCP. Two clocks:

lockstep  At every control tick the plant waits for the setpoint that the bridge sent for this
          tick's IMU sample, for joint efforts and magnet, and for the autopilot's motor commands.
          It also waits for a recorder that has fallen far behind, so that nothing is lost.
          Every wait is bounded in wall time; when one ends, the node says who did not answer.
          Where a lost node is being started again, ticks go on at the pace of the wall clock
          without its answers, until all have come in time for a while: the flight is lost or saved
          as in real time.
realtime  Ticks begin at absolute deadlines of the wall clock, `control period` apart; after a stall
          of the machine they follow each other at most CATCH_UP times as fast. What has not arrived
          by the next deadline is missing, and what was commanded last holds. A control tick counts
          as missed when its setpoint was never sent, or some control periods after its IMU sample
          (`latencies.py`). The latency of a tick is the time between these two publications;
          beyond one control period it counts as late.
          The bridge publishes /uam/setpoint when it has sent the setpoint to the autopilot, which
          therefore has it by then.
"""

from __future__ import annotations

import gc
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

from uam_control.coordinates import POSITION
from uam_control.mission.time_limit import DISARMED, Settled
from uam_control.settings.parameter_set import ParameterError
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_msgs_py.node.base_node import StopSignal, refuse
from uam_msgs_py.node.connections import Connections, of
from uam_msgs_py.node.executor import LeanExecutor
from uam_msgs_py.node.node_parameters import refuse_unknown
from uam_msgs_py.node.tunable import TunableNode
from uam_sim_bridge.faults import PLANT, Schedule
from uam_sim_bridge.faults.faulty_plant import FaultyPlant, make_plant
from uam_sim_bridge.mavlink.hil.hil_server import HilParameters, HilServer
from uam_sim_bridge.nodes.fault_topic import FaultTopic
from uam_sim_bridge.nodes.latencies import Latencies
from uam_sim_bridge.nodes.plant_health import PlantHealth
from uam_sim_bridge.nodes.plant_options import NOT_READY, Options, Statistics, declare
from uam_sim_bridge.nodes.plant_topics import SUSPECTS, Answers, Sensors, TruthTopics, nanoseconds
from uam_sim_bridge.nodes.restart import Restart
from uam_sim_bridge.patience import Patience
from uam_sim_bridge.plant import Plant, Samples, Truth, Vehicle

NAME = "mujoco_sim"
REPORT_INTERVAL = 5.0  # [s] between two lines that say who is waited for
CATCH_UP = 1.25  # [1] times real time, after a stall of the machine, which had no time to spare
FOREIGN_WAIT = 1.0  # [s] for a foreign node to find us as well: it does not say when it has
LAST_WAIT = 3.0  # [s] for a recorder that has not seen the last tick, and may have lost it
RECORDER_LAG = 2.0  # [s] it tells once a second how far it is, and keeps four times as much
SERVICE_TICKS = 25  # in real time the parameter services are looked after every so many ticks


class PlantStopped(RuntimeError):
    """The flight cannot go on; the text is one line and says who did not answer."""


class NotReady(PlantStopped):
    """Not everyone came, or found the others."""


class Simulator:
    """Plant, topics and autopilot link, tick by tick."""

    def __init__(self, node: TunableNode, options: Options, stop: StopSignal):
        self.node, self.options, self._stop = node, options, stop
        vehicle = Vehicle.load(options.vehicle).changed(json.loads(options.vehicle_changes))
        described = vehicle.description
        start = (vehicle, options.payload_mass, options.seed, tuple(options.arm_start))
        faults = Schedule.from_text(options.faults).only(PLANT)
        self.plant = make_plant(*start, faults, options.plant)
        self._faulty = self.plant if isinstance(self.plant, FaultyPlant) else None
        self._fault_topic = FaultTopic(node) if faults else None
        _warm_up(make_plant(*start, Schedule(), options.plant))
        self.sensors, self.truth = Sensors(node, described), TruthTopics(node, described)
        self.answers = Answers(node, described)
        self.connections = Connections(node)
        self.executor = LeanExecutor(node, [topics.SETPOINT.name], lambda: self._setpoint_is_there)
        patience = options.answer_timeout
        rotors = len(described.rotors)
        waits = HilParameters(answer_timeout=patience)
        if options.autopilot_always_answers:
            waits = HilParameters(answer_timeout=patience, silent_timeout=patience)
        self.hil = HilServer(options.hil_port, rotors, parameters=waits, seed=options.seed)
        self.statistics = Statistics(options.clock)
        self.health = PlantHealth(node, self.answers, self.statistics)
        self._foreign = tuple(filter(None, options.foreign.split(",")))
        self._setpoint_is_there = False  # as a rule it is the last answer to arrive
        self._complete = False  # every kind of sensor has delivered
        self._stamp: int | None = None  # of this tick's IMU sample [ns]
        self._published = 0  # wall time [ns] of its publication
        self._restart = Restart(options.answer_timeout)
        self._begun = 0.0  # wall time [s] at which this tick began
        self._begun_at = 0.0  # and simulation time [s]
        self._latencies = Latencies(self.statistics, self.plant.period)

    def wait_for_everyone(self) -> None:
        """Return when all nodes are connected to each other and the autopilot to us."""
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
            if waiting != missed:  # a slow machine gets on, too
                patience, missed = Patience(limit or math.inf), waiting
            if patience.over:
                raise NotReady(f"no progress for {limit:g} s, waiting for {_listed(waiting)}")
            if waiting != last and now - reported > 1.0 or now - reported > REPORT_INTERVAL:
                print(f"{NAME}: waiting for {_listed(waiting)}", flush=True)
                reported, last = now, waiting
        settled = time.monotonic() + (FOREIGN_WAIT if self._foreign else 0.0)
        while time.monotonic() < settled and not self._stop.raised:
            self.executor.spin_once(0.05)
        print(f"{NAME}: everyone is there", flush=True)

    def _waiting_for(self) -> list[str]:
        recorded, foreign = self.options.recorded, self._foreign
        wires = wiring.with_foreign(self.node, foreign)
        waiting = wiring.missing(self.node, recorded, wires)
        if not waiting:  # the ends exist; have they found each other?
            plant = of(self.sensors.outlets | self.truth.outlets, self.answers.inlets)
            waiting = list(wiring.unconnected(self.connections, plant, recorded, wires, foreign))
        if not self.hil.accept(0.0):
            waiting.append(f"autopilot to connect to TCP port {self.options.hil_port}")
        return waiting

    def run(self) -> None:
        """Fly until the mission is done, the time limit, or SIGINT."""
        realtime = self.options.clock == "realtime"
        limit, end = self.options.time_limit or math.inf, math.inf
        gc.collect()
        gc.freeze()  # what exists now stays; later collections need not look at it
        begin, settled = time.monotonic(), Settled()
        while not self._stop.raised:
            begun = time.perf_counter()
            samples, truth = self._begin_tick()
            if realtime:
                self._send_hil(samples, truth)
                self._wait_until(self._deadline(begin))
                self._measure()
                self._receive_hil(0.0)
            else:
                self._wait_for_answers()
                self._send_hil(samples, truth)
                self._receive_hil()
            if self._faulty:
                told = self.answers
                self._faulty.mission_at(told.mission_stamp * 1e-9, told.mission.time)
            self.plant.step(self.hil.motors, self.answers.effort, self.answers.magnet)
            self.health.done_tick(begun, self.plant.time)
            if self.answers.mission.done and not self.statistics.ended_by:
                self.statistics.ended_by = "mission"
                end = self.plant.time + self.options.linger
            if self.plant.time >= end:
                break
            if settled.over(self.plant.time, self.hil.armed) and not self.statistics.ended_by:
                self.statistics.ended_by = DISARMED
                break
            if self.plant.time >= limit:
                self.statistics.ended_by = self.statistics.ended_by or f"time limit of {limit:g} s"
                break
        else:
            self.statistics.ended_by = "interrupt"
        self.statistics.wall_s = time.monotonic() - begin
        self._recorder_has_caught_up(0.0, LAST_WAIT)  # what we have published goes when we go

    def _deadline(self, begin: float) -> float:
        """Wall time [s] at which the next tick of a flight begun at `begin` begins.

        After a stall ticks come faster, but not in a burst that nobody could follow.
        """
        on_time = begin + (self.plant.tick + 1) * self.plant.period
        return max(on_time, self._begun + self.plant.period / CATCH_UP)

    def _begin_tick(self) -> tuple[Samples, Truth]:
        """Publish what is due at this tick."""
        plant = self.plant
        self._begun, self._begun_at = time.monotonic(), plant.time
        now = self.node.stamp = nanoseconds(plant.time)
        self.answers.begin()
        samples, truth = plant.sense(), plant.truth()
        if self._faulty and self._faulty.changed:
            self._fault_topic.tell(now, self._faulty.changed)
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
        if not self._recorder_has_caught_up(RECORDER_LAG, self.options.answer_timeout):
            raise PlantStopped(
                f"nothing recorded since {self.connections.recorded_until():g} s"
                "; the recorder is silent"
            )
        if self._stamp is None or self._stop.raised:
            return
        patience = Patience(self.options.answer_timeout)
        while missing := self.answers.missing(self._stamp):
            self._setpoint_is_there = "setpoint" not in missing
            left = self._begun + self.plant.period - time.monotonic()
            self.executor.spin_once(max(0.0, left) if self._restart.going_on else 0.1)
            self._restart.look(self.answers.restarts)
            if self._stop.raised or (self._restart.going_on and left <= 0.0):
                break
            if patience.over:
                raise PlantStopped(self._no_answer(missing))
        self._restart.tick(complete=not missing)

    def _recorder_has_caught_up(self, lag: float, patience: float) -> bool:
        """Wait until it is not more than `lag` [s] behind what was published; False: it stays so.

        patience: longest wait [s of wall time].
        """
        waiting = Patience(patience)
        while self.options.recorded and not self._stop.raised:
            if self._begun_at - self.connections.recorded_until() <= lag:
                break
            if waiting.over:
                return False
            self.executor.spin_once(0.1)
        return True

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
        """Note what became of this tick, and of those whose setpoints have arrived."""
        self._latencies.tick(self._stamp, self._published, self.answers.setpoints)
        self.answers.setpoints.clear()

    def report(self) -> Statistics:
        """The statistics so far; ticks never answered count, except those still on their way."""
        numbers = self.statistics
        numbers.ticks, numbers.simulated_s = self.plant.tick, self.plant.time
        self._latencies.conclude(self._published)
        numbers.late_motor_commands = self.hil.missed
        return numbers

    def close(self) -> None:
        """End the link to the autopilot."""
        self.hil.close()
        self.executor.shutdown()


def _warm_up(spare: Plant) -> None:
    """Compile what a tick calls, on a plant that is thrown away: a first call takes long."""
    for _ in range(10):
        spare.sense()
        spare.truth()
        rotors = len(spare.vehicle.description.rotors)
        spare.step(np.zeros(rotors), np.zeros(spare.joints), False)


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
    node = TunableNode(NAME)
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
            return NOT_READY if isinstance(error, NotReady) else 1
        return 0
    except ParameterError as error:
        return refuse(NAME, error)
    finally:
        if simulator is not None:
            simulator.close()
            if options.statistics:
                Path(options.statistics).write_text(json.dumps(simulator.report().to_mapping()))
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    raise SystemExit(main())
