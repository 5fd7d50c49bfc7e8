"""Node: the cockpit, a local web page; see uam_lab.cockpit. No other node waits for it."""

import queue
import time
from collections.abc import Callable
from dataclasses import dataclass

import psutil
from rclpy.node import Node

from uam_control.nodes.described import described_vehicle
from uam_control.settings import configuration, yaml_file
from uam_control.settings.parameter_set import ParameterSet, integer, text
from uam_lab.cockpit import web
from uam_lab.cockpit.page import Page
from uam_lab.cockpit.page_address import LOCAL, PORT, AddressError
from uam_lab.cockpit.services import Services
from uam_lab.cockpit.watch import Watch
from uam_lab.cockpit.web import PlainPage
from uam_msgs_py.node.answering import ServingExecutor
from uam_msgs_py.node.base_node import StopSignal, refuse, run_with
from uam_msgs_py.node.node_parameters import NodeParameters, refuse_unknown
from uam_msgs_py.node.rightful import rightful_nodes

INTERVAL = 1.0  # [s] of one measurement
SHARE = 0.08  # [cores] for this process while the machine is short; the limit is a tenth
BUSY = 0.85  # of all processor time: from here on the machine is short
REST = 10  # measurements without shortage before the page shows everything again
STEP = 2.0  # largest change of the period per measurement
NAME = "cockpit"
OPTIONS = "views/cockpit.yaml"
ASKED_WITHIN = 0.8  # [s] every page asks for the state once: watching.html.j2


class FrameRate:
    """Period between two frames, from the processor time of this process and of the machine."""

    def __init__(
        self,
        fastest: float,
        slowest: float,
        clock: Callable[[], float] = time.monotonic,
        own: Callable[[], float] | None = None,
        machine: Callable[[], float] | None = None,
    ) -> None:
        """fastest, slowest: periods [s]; own: processor time of this process so far [s]; machine:
        used share of all processor time since the last call, 0..1."""
        self._fastest, self._slowest, self._clock = fastest, slowest, clock
        self._own = own or (lambda: sum(psutil.Process().cpu_times()[:2]))  # of user and system
        self._machine = machine or (lambda: psutil.cpu_percent() / 100.0)
        self._machine()
        self._last = clock(), self._own()
        self.period = fastest  # [s]
        self.short = False  # whether the machine is short
        self.cores = 0.0  # used by this process
        self.sparing = False  # whether the slowest frame rate still costs too much
        self._rested = 0  # measurements since the machine was last short

    def measure(self) -> None:
        """Adapt the period to the last INTERVAL; call it with each frame."""
        now, used = self._clock(), self._own()
        spent = now - self._last[0]
        if spent < INTERVAL:
            return
        self.cores, self._last = (used - self._last[1]) / spent, (now, used)
        self.short = self._machine() >= BUSY
        factor = self.cores / SHARE if self.short else 1.0 / STEP
        factor = min(STEP, max(1.0 / STEP, factor))
        before, self.period = (
            self.period,
            min(self._slowest, max(self._fastest, self.period * factor)),
        )
        self._rested = 0 if self.short else self._rested + 1
        if self.short and before >= self._slowest and self.cores > SHARE:
            self.sparing = True
        elif self._rested >= REST:
            self.sparing = False


@dataclass(frozen=True)
class CockpitParameters(ParameterSet):
    """Address of the page; it cannot change while the node runs."""

    host: str = text(LOCAL, "address at which the page is served", f"{LOCAL}: this computer only")
    port: int = integer(PORT, "TCP port; the next free one from it on, 0: any", 0, 65535)
    results: str = text("", "folder of the results", "shown when the flight is over; or empty")
    origins: str = text(
        "", "other pages that may connect", "as http://name:port, with commas between; empty: none"
    )


def main() -> int:
    """Serve the page until SIGINT or SIGTERM; return the exit status."""
    stop = StopSignal()
    status = run_with(NAME, lambda node: _serve(node, stop))
    stop.ignore()
    return status


def _serve(node: Node, stop: StopSignal) -> int:
    options = yaml_file.read(configuration.path(OPTIONS), configuration.ConfigurationError)
    served = NodeParameters(node, CockpitParameters, read_only=True).current
    vehicle = described_vehicle(node)
    rightful = rightful_nodes(node)
    refuse_unknown(node)
    origins = [one for one in served.origins.split(",") if one]
    todo = queue.SimpleQueue()
    plain = PlainPage(todo.put, served.results)
    try:
        server = web.serve(served.host, served.port, "uam", plain, origins)
    except AddressError as error:
        return refuse(NAME, error)
    print(f"{NAME}: {web.url(server)}", flush=True)
    executor = ServingExecutor()
    executor.add_node(node)
    # not spun: an executor would take the messages that the page polls
    watcher = Node(f"{NAME}_watch", start_parameter_services=False, enable_rosout=False)
    page = Page(
        server,
        Watch(watcher, rightful),
        Services(node),
        options,
        vehicle,
        plain,
        todo,
        node.get_namespace(),
    )
    rate = FrameRate(options["scene_period"], options["slowest_period"])
    while not stop.raised:
        end = time.monotonic() + rate.period
        page.look()
        rate.measure()
        page.spare(rate.sparing)
        while (left := end - time.monotonic()) > 0.0 and not stop.raised:
            executor.spin_once(timeout_sec=left)
    if page.end():
        time.sleep(ASKED_WITHIN)
    server.stop()
    watcher.destroy_node()
    return 0
