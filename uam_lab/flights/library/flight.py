"""A flight as an object: started, watched, commanded and evaluated from Python."""

from __future__ import annotations

import asyncio
import math
import shlex
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_control.supervision.preflight import UNKNOWN
from uam_lab.flights import flight_settings
from uam_lab.flights.conclude import conclude
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.flights.flight_settings import FlightSettings, SettingsError
from uam_lab.flights.library.flight_result import (
    CommandRefused,
    FlightEnded,
    FlightError,
    FlightFailed,
    FlightResult,
)
from uam_lab.flights.library.history import Awaited, History, Kind, awaited
from uam_lab.flights.observer import FlightStatus, Observer
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder
from uam_sim_bridge.faults import PROCESS, FaultError, Schedule
from uam_sim_bridge.faults.schedule import timed

if TYPE_CHECKING:
    from uam_lab.flights.library.commands import Changes, Commands, Hand
    from uam_lab.flights.processes.guest import Guest

CONNECTED = 60.0  # [s] of wall time for the nodes to find each other before a command
START_PATIENCE = 10.0  # [s] of wall time for the first values of the pre-arm report
POLL = 0.05  # [s] between two tries of a start
Engine = Callable[[FlightSettings, ResultFolder, Observer, StopRequest], Outcome]


class Flight:
    """One flight; several may run at once, each in its own ROS domain.

        with Flight(scenario="pick_and_place", seed=3) as flight:
            flight.wait_for("carry")
            result = flight.wait()

    A flight is also an asynchronous context manager. At the end of the `with` block a flight that
    still runs is stopped: its recording ends there. With engine="direct" there are no nodes, so
    nothing can be waited for, set or commanded before the end.
    """

    def __init__(
        self,
        *,
        observer: Observer | None = None,
        checked: FlightSettings | None = None,
        stop: StopRequest | None = None,
        flown_by: Engine | None = None,
        **options: Any,
    ) -> None:
        """options: see `uam_lab.flights.flight_options.FlightOptions`; observer: for the progress.

        checked: settings in place of options; stop: to end the flight; flown_by: None for the
        engine of the settings. Raises SettingsError and what `flight_settings.settings` raises;
        nothing is started yet.
        """
        if observer is not None and not isinstance(observer, Observer):
            raise SettingsError(f"observer: an Observer expected, got {observer!r}")
        if checked is None:
            options.setdefault("command", shlex.join(["python", *sys.argv]))
            checked = flight_settings.settings(**options)
        self.settings, self._engine = checked, flown_by
        self._history, self._stop = History(observer or Observer()), stop or StopRequest()
        self._thread: threading.Thread | None = None
        self._folder: ResultFolder | None = None
        self._result: FlightResult | None = None
        self._error: BaseException | None = None
        self._raised = False  # whether the caller has got the error
        self._clients: Commands | None = None
        self._lock = threading.Lock()

    # --- begin and end ---------------------------------------------------------------------

    def launch(self) -> Flight:
        """Start the nodes; return when their processes run. `with` calls it.

        Raises FlightError if it was launched before, ResultFolderError, PortError, SettingsError
        without ROS.
        """
        if self._thread is not None:
            raise FlightError("a Flight flies once: make another one")
        if self.settings.engine == "ros":
            flight_settings.require_ros()
        if self._engine is None:  # a vehicle's own engine waits for its devices
            flight_settings.require_device(self.settings.link)
        prepare(self._history.message)
        settings = self.settings
        self._folder = ResultFolder.create(
            settings.scenario.name, settings.controller, settings.out
        )
        name = f"flight {self._folder.path.name}"
        self._thread = threading.Thread(target=self._fly, name=name, daemon=True)
        self._thread.start()
        self._history.wait(lambda: self._history.running or self._history.over, None, "start")
        self._raise_error()
        return self

    def close(self) -> None:
        """End the flight if it still runs; return when all of its processes have ended."""
        if self._thread is None:
            return
        if not self._history.over:
            self._stop.repeat()
        self._thread.join()

    def stop(self, at_once: bool = False) -> None:
        """Request the end of the flight: in order, or without waiting for the nodes."""
        for _ in range(2 if at_once else 1):
            self._stop.repeat()

    def _fly(self) -> None:
        """Fly and evaluate, in the flight's thread."""
        folder = self._folder
        try:
            fly = self._engine or _engine(self.settings.engine)
            outcome = fly(self.settings, folder, self._history, self._stop)
            metrics = conclude(self.settings, folder, outcome)
            self._result = FlightResult(folder.path, metrics, outcome)
            if outcome.series is None:
                folder.give_latest_back()
        except BaseException as error:  # raised again in the caller's thread
            self._error = error
            folder.remove_if_empty()
        finally:
            if self._clients is not None:
                self._clients.close()
            folder.release()
            self._history.end()

    def __enter__(self) -> Flight:
        return self.launch()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close()
        if kind is None:
            self._raise_error()
            self._raise_failure()

    async def __aenter__(self) -> Flight:
        return await asyncio.to_thread(self.launch)

    async def __aexit__(self, kind: type[BaseException] | None, *_: object) -> None:
        await asyncio.to_thread(self.__exit__, kind)

    # --- waiting ---------------------------------------------------------------------------

    def wait(self, timeout: float | None = None) -> FlightResult:
        """Wait for the end of the flight; return its result, also of an aborted mission.

        timeout: [s] of wall time. Raises NotInTime, FlightFailed after a technical failure.
        """
        self._launched()
        self._history.wait(lambda: self._history.over, timeout, "end of the flight")
        return self._finished()

    async def wait_async(self, timeout: float | None = None) -> FlightResult:
        """Return as `wait`, without blocking the event loop."""
        self._launched()
        await self._history.wait_async(lambda: self._history.over, timeout, "end of the flight")
        return self._finished()

    def wait_for(self, what: Kind, timeout: float | None = None) -> FlightStatus:
        """Wait for a phase, a state or a condition; return the status that meets it.

        what: name of a phase of the scenario or of a supervisor's state, or a function of a
        FlightStatus. A status since the last wait or command counts, so no short phase is missed.
        timeout: [s] of wall time. Raises NotInTime; FlightEnded if the flight ends before.
        """
        watch = self._waiting(what)
        self._history.wait(watch.done, timeout, watch.name)
        return self._met(watch)

    async def wait_for_async(self, what: Kind, timeout: float | None = None) -> FlightStatus:
        """Return as `wait_for`, without blocking the event loop."""
        watch = self._waiting(what)
        await self._history.wait_async(watch.done, timeout, watch.name)
        return self._met(watch)

    def _met(self, watch: Awaited) -> FlightStatus:
        """Return the status that was waited for. Raises FlightEnded."""
        if watch.status is None:
            self._raise_error()
            raise FlightEnded(f"the flight ended before {watch.name}: {self._end()}")
        return watch.status

    def _waiting(self, what: Kind) -> Awaited:
        self._need_nodes("wait for a phase")
        return awaited(self._history, what, [name for _, name in self.settings.scenario.phases])

    # --- what is known ---------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether the flight has been launched and has not ended."""
        return self._thread is not None and not self._history.over

    @property
    def status(self) -> FlightStatus | None:
        """The newest status, None before the first."""
        return self._history.statuses[-1] if self._history.statuses else None

    @property
    def messages(self) -> list[str]:
        """The lines about the flight so far, as `uam fly` prints them."""
        return list(self._history.messages)

    @property
    def domain(self) -> int | None:
        """ROS domain of the nodes; None before the launch and with the direct engine."""
        return self._history.domain

    @property
    def folder(self) -> Path:
        """The result folder. Raises FlightError before the launch."""
        self._launched()
        return self._folder.path

    @property
    def result(self) -> FlightResult:
        """The result, also of a failed flight. Raises FlightError while it flies."""
        if self._result is None:
            self._raise_error()
            raise FlightError("no result before the end of the flight: wait()")
        return self._result

    # --- commands --------------------------------------------------------------------------

    def start(self) -> str:
        """Arm and take off, if the pre-arm report is green (with auto_start=False).

        Returns the answer, as do all commands. Waits for values that are still unknown after the
        launch, for at most START_PATIENCE. Raises CommandRefused with the reason.
        """
        end = time.monotonic() + START_PATIENCE
        while True:
            try:
                return self._command("start")
            except CommandRefused as refusal:
                if UNKNOWN not in str(refusal) or time.monotonic() > end:
                    raise
            time.sleep(POLL)

    def hold(self) -> str:
        """Stop on the path and hold the position."""
        return self._command("hold")

    def resume(self) -> str:
        """Continue on the path after a hold; regain a vehicle that another one controls."""
        return self._command("resume")

    def land(self) -> str:
        """Descend vertically and disarm."""
        return self._command("land")

    def disarm(self) -> str:
        """Stop the motors: on the ground, or in failsafe."""
        return self._command("disarm")

    def kill(self) -> str:
        """Stop the motors at once, in the air too: the vehicle falls."""
        return self._commands().ask("kill")

    def goto(self, x: float, y: float, z: float, yaw: float | None = None) -> str:
        """Fly to a position [m, ENU] and hold it; yaw [rad], None: keep the heading."""
        return self._commands().ask("goto", x, y, z, math.nan if yaw is None else yaw)

    @property
    def hand(self) -> Hand:
        """The end effector: `flight.hand.goto(...)`, `.plan(...)`, `.pose`."""
        from uam_lab.flights.library.commands import Hand

        return Hand(self._commands)

    def plan(self, message: Any) -> str:
        """Fly a PoseStamped, or a MultiDOFJointTrajectory of the base, or a JointTrajectory.

        Returns the mission's answer. Raises CommandRefused with its reason (docs/scenarios.md).
        """
        return self._commands().ask("plan", message)

    def set_parameters(self, node: str | Mapping[str, Mapping[str, Any]], **values: Any) -> Changes:
        """Set parameters of a node in flight, or of several: node → name → value.

        All are applied between two ticks, or none. Returns node → name → (old, new). Raises
        CommandRefused with the reason.
        """
        asked = {node: values} if isinstance(node, str) else node
        desired = {one: _of_python(given) for one, given in asked.items()}
        return self._commands().change(lambda switch: switch.change(desired))

    def set_profile(self, *names_or_files: str | Path) -> Changes:
        """Switch to another profile in flight, see `load_profile`; otherwise as set_parameters."""
        given = [str(configuration.named("profiles", str(one))) for one in names_or_files]
        flown = self.settings
        profile = load_profile(*given, vehicle=flown.vehicle, namespace=flown.namespace)
        return self._commands().change(lambda switch: switch.switch(profile))

    def inject(self, fault: str, duration: float = math.inf, **parameters: Any) -> None:
        """Inject a fault of a process now, as inject("node_stall", 2.0, node="arm_controller").

        duration: [s] of wall time. Faults of plant and link are planned before the flight: option
        faults. Raises FaultError.
        """
        self._need_nodes("inject a fault")
        lasting = {} if math.isinf(duration) else {"duration": duration}
        one = timed({"fault": fault, "at": 0.0, **lasting, **parameters}, {}, "inject")
        if one.fault.PLACE != PROCESS:
            raise FaultError(f"{fault}: plan a fault of the {one.fault.PLACE} by option faults")
        flight_settings.check_feasible(self.settings, Schedule((one,)))
        self._stop.injected.put(one)

    def node(self, name: str) -> Guest:
        """Return a context manager with `.node`, a new rclpy node in the flight's graph."""
        self._need_nodes("add a node")
        return self._clients_of_domain().guest(name)

    def _command(self, name: str) -> str:
        commands = self._commands()
        self._history.forget()
        return commands.ask("command", name)

    def _commands(self) -> Commands:
        """Return the clients, when the nodes have found each other."""
        self._need_nodes("send a command")
        history = self._history
        history.wait(lambda: history.statuses or history.over, CONNECTED, "status of the mission")
        if history.over:
            raise FlightEnded(f"the flight has ended: {self._end()}")
        return self._clients_of_domain()

    def _clients_of_domain(self) -> Commands:
        from uam_lab.flights.library.commands import Commands
        from uam_lab.flights.ros.node_arguments import common_remappings

        with self._lock:
            if self._clients is None:
                self._clients = Commands(
                    self.domain, self.settings.namespace, common_remappings(self.settings)
                )
            return self._clients

    # --- errors ----------------------------------------------------------------------------

    def _launched(self) -> None:
        if self._thread is None:
            raise FlightError("the flight is not launched: use `with Flight(...) as flight`")

    def _need_nodes(self, purpose: str) -> None:
        self._launched()
        if self.settings.engine != "ros":
            raise FlightError(f"the direct engine has no nodes: to {purpose} needs engine='ros'")

    def _finished(self) -> FlightResult:
        self._raise_error()
        self._raise_failure()
        return self._result

    def _raise_error(self) -> None:
        if self._error is not None and not self._raised:
            self._raised = True
            raise self._error

    def _raise_failure(self) -> None:
        result = self._result
        if result is not None and result.outcome.failure and not self._raised:
            self._raised = True
            raise FlightFailed(result.outcome.failure, result)

    def _end(self) -> str:
        if self._result is None:
            return str(self._error)
        return self._result.reason or "mission completed"


def _engine(name: str) -> Engine:
    if name == "direct":
        from uam_lab.flights.direct.flight import fly as engine
    else:
        from uam_lab.flights.ros.engine import fly as engine
    return engine


def _of_python(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with lists and numbers in place of those of numpy."""
    return {
        k: v.tolist() if isinstance(v, np.ndarray | np.generic) else v for k, v in values.items()
    }
