"""Node: records every topic of the stack to an MCAP file, a bag of ROS 2.

Log time is simulation time, with `simulated: false` wall time; see `recording/topic_recorder.py`.
A log is never overwritten.
"""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    integer,
    number,
    switch,
    text,
)
from uam_control.settings.process_parameters import ProcessParameters
from uam_control.stamps import SECOND
from uam_lab.records.recording.bag import new_log_file
from uam_lab.records.recording.topic_recorder import TopicRecorder
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.serialized import Template
from uam_msgs_py.messages.status import ERROR, OK, WARN, diagnostic
from uam_msgs_py.node import process_options, wiring
from uam_msgs_py.node.answering import ServingExecutor
from uam_msgs_py.node.base_node import DIAGNOSTICS_PERIOD, StopSignal, run_with
from uam_msgs_py.node.health import LoopTime, ages
from uam_msgs_py.node.namespace import label
from uam_msgs_py.node.node_files import write_json
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_msgs_py.node.rightful import RightfulNodes, rightful_nodes

NAME = "recorder"
POLLS_PER_SERVICE = 5  # polls between two calls of the parameter services


@dataclass(frozen=True)
class RecorderParameters(ParameterSet):
    """Files and periods of the recorder; they cannot change while the node runs."""

    file: str = text(
        "", "the log to write", "a new file; empty: log-<time>/log.mcap in this folder"
    )
    statistics: str = text("", "JSON file to write at the end", "a file; empty: none")
    facts: str = text(
        "", "JSON file with texts for the log, see recording/log_facts.py", "a file; empty: none"
    )
    simulated: bool = switch(True, "log time is that of /clock and stamps; false: wall time")
    size_limit: float = number(0.0, "size at which the log ends, 0 = none", "MB", 0.0, 1e6)
    flush_period: float = number(0.5, "time between two writes to the disk", "s", 0.02, 60.0)
    poll_period: float = number(0.02, "time between two polls of the topics", "s", 0.001, 1.0)
    fifo_priority: int = integer(
        0, "real-time priority under SCHED_FIFO; 0: none. Below that of the nodes that fly", 0, 98
    )


class Progress:
    """Publishes the simulation time up to which every topic is recorded."""

    def __init__(self, node: Node) -> None:
        self._publisher = topics.RECORDED_UNTIL.outlet(node)
        self._writer, self._until = Template(Clock()), 0

    def tell(self, until: int) -> None:
        """Publish `until` [ns] if it has changed."""
        if until != self._until:
            self._until = until
            self.repeat()

    def repeat(self) -> None:
        """Publish the last time again: a message may be lost."""
        self._publisher.publish(self._writer.stamped(self._until))


def _health(
    node: Node,
    recording: TopicRecorder,
    polls: LoopTime,
    new: Sequence[str],
) -> DiagnosticArray:
    """Return the node's /diagnostics entry: lost messages, loop times, connections.

    new: lines about messages refused since the last entry.
    """
    lost = sum(recording.lost.values())
    summary = recording.log.ended or (f"{lost} messages lost" if lost else "recording")
    values = {"messages lost": lost, "lost of": _losses(recording)}
    values["recorded until [s]"] = recording.until / SECOND
    namespace = node.get_namespace()
    values |= polls.report("poll") | ages(recording.inlets, recording.arrivals, namespace)
    values |= wiring.connection_counts(node, {}, recording.inlets)
    now = node.get_clock().now().nanoseconds
    values |= recording.door.values()
    level = ERROR if recording.log.ended else WARN if lost else OK
    if new and not recording.log.ended:
        level, summary = ERROR, "; ".join(new)
    return diagnostic(now, label(node), level, summary, values)


def _losses(recording: TopicRecorder) -> str:
    """Return the lost messages with their topics and publishers."""
    return "; ".join(
        f"{topic} of {node}: {count}"
        for topic, counts in recording.lost_by_publisher.items()
        for node, count in counts.items()
    )


def _open(node: Node, options: RecorderParameters, rightful: RightfulNodes) -> TopicRecorder:
    """Create the log and its subscriptions. Raises ParameterError in one line."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    file = Path(options.file).expanduser() if options.file else new_log_file(stamp)
    source = options.facts
    try:
        facts = json.loads(Path(source).read_text(encoding="utf-8")) if source else None
    except (OSError, ValueError) as error:
        raise ParameterError(f"facts: {source} cannot be read: {error}") from None
    try:
        chosen, limit = topics.RECORDED, options.size_limit
        made = TopicRecorder(node, file, chosen, options.simulated, rightful, facts, limit)
    except FileExistsError:
        raise ParameterError(
            f"file: {file} exists; a log is never overwritten, give another name"
        ) from None
    except OSError as error:
        raise ParameterError(f"file: cannot write {file}: {error.strerror}") from None
    node.get_logger().info(f"{len(chosen)} topics to {file}")
    return made


def _complete(node: Node, recording: TopicRecorder, statistics: str) -> None:
    """Complete the log, then write the file `statistics`, "" for none; say what cannot be written.

    The disk may be full: the statistics say so even if the bag's metadata found no room.
    """
    log = node.get_logger()
    try:
        if not recording.close():
            log.warning(
                "the folder has the metadata.yaml of another log: give this one's file a name"
            )
    except OSError as error:
        log.error(f"metadata.yaml cannot be written: {error.strerror}")
    if recording.lost:
        log.warning(f"messages were lost: {_losses(recording)}")
    lost, written = recording.lost, recording.log
    summary = {"messages": written.counts, "lost": lost, "ended": written.ended}
    write_json(node, statistics, summary)


def main() -> int:
    """Record until SIGINT or SIGTERM, then complete the file; return the exit status.

    2: bad parameters, a file that exists or cannot be written, in one line.
    """
    # the signal must not close the ROS context: received messages are still to be written
    stop = StopSignal()
    return run_with(NAME, lambda node: _record(node, stop))


def _record(node: Node, stop: StopSignal) -> int:
    log = node.get_logger()
    options = NodeParameters(node, RecorderParameters, read_only=True).current
    rightful = rightful_nodes(node)
    refuse_unknown(node)
    recording = _open(node, options, rightful)
    process_options.apply(ProcessParameters(fifo_priority=options.fifo_priority))
    health = topics.DIAGNOSTICS.outlet(node)
    progress = Progress(node)
    services = ServingExecutor()
    services.add_node(node)
    polls_per_flush = max(1, round(options.flush_period / options.poll_period))
    polls, loop, ended = 0, LoopTime(), ""
    due = 0.0  # time.monotonic() of the next comparison
    while not stop.raised:
        time.sleep(options.poll_period)
        begun = time.perf_counter()
        recording.poll()
        loop.add(begun)
        polls += 1
        if polls % POLLS_PER_SERVICE == 0:
            services.spin_once(timeout_sec=0.0)
        progress.tell(recording.until)
        if polls % polls_per_flush == 0:
            recording.log.flush()
            progress.repeat()
            if recording.log.ended and not ended:
                ended = recording.log.ended
                log.error(f"{ended}; recorded until {recording.until / SECOND:g} s")
            new: list[str] = []
            if time.monotonic() >= due:
                due = time.monotonic() + DIAGNOSTICS_PERIOD
                if new := recording.door.news():
                    log.error("; ".join(new))
            health.publish(_health(node, recording, loop, new))
    recording.drain()
    _complete(node, recording, options.statistics)
    services.shutdown()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
