"""`uam fly`: fly a scenario and write a result folder.

Start every node, fly a scenario, write a result folder.

examples:
  uam fly                                    the paper's mission, default profile
  uam fly --scenario hover --seed 7          another scenario, other noise
  uam fly --scenario path.csv --no-video     a trajectory from a file
  uam fly --scenario circle_fast --end land  a curve of the library; it lands where it ends
  uam fly --scenario ellipse --retime        too fast for the vehicle: slowed down
  uam fly --profile mine.yaml --engine direct
  uam fly --engine direct --no-report        recording and metrics only, in seconds
  uam fly --autopilot px4 --px4-dir ~/PX4-Autopilot/build/px4_sitl_default
  uam fly --autopilot px4 --px4-param COM_OF_LOSS_T=1.0 --px4-param SDLOG_MODE=0
  uam fly --autopilot serial:/dev/ttyACM0:921600 --clock realtime --gcs udp:127.0.0.1:14550
  uam fly --dry-run                          all commands computed, none sent, nothing armed
  uam fly --view --clock realtime            monitor and tune in a browser
  uam fly --clock realtime                   paced by the wall clock, latency measured
  uam fly --clock realtime --fifo 50 --lock-memory    the nodes ahead of other programs
  uam fly --namespace uav1 --domain 1        one of several vehicles in a ROS domain
  uam fly --without arm_controller           with your own arm controller: examples/
  uam fly --fused                            control nodes in one process: fewer cores
  uam fly --fused --fifo 1                   lockstep ahead of other programs: faster
  uam fly --imu autopilot                    the estimator has the autopilot's IMU
  uam fly --payload-mass 0.3 --wind 2 0 0    heavier payload, 2 m/s from the west
  uam fly --setpoint-delay 16 --mocap-delay 8 --mocap-jitter 4    later by so many milliseconds
  uam fly --plant-preset laboratory          a plant as hard as a laboratory: docs/plant.md
  uam fly --plant-preset laboratory --effect joint_gear=off --effect downwash:drag=2
  uam fly --fault mocap_dropout@20+3         no motion capture from 20 s on, for 3 s
  uam fly --fault motor_loss@pick+1:motor=2,remaining=0.7

A trajectory has the columns t,px,py,pz and any of yaw | qw,qx,qy,qz; vx,vy,vz; ax,ay,az; dyaw;
alpha_1,alpha_2 (SI, ENU). A scenario that exceeds a limit of the vehicle is refused.
Exit status: 0 mission or dry run completed, 1 flown but not completed, 2 wrong use.
"""

import argparse
import contextlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from uam_control.laws import catalogue
from uam_control.settings import configuration
from uam_lab.cli.command import Command, chosen_process, number
from uam_lab.flights import flight_settings
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_options import FlightOptions
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.library.flight import Engine, Flight
from uam_lab.flights.library.flight_result import FlightFailed, FlightResult
from uam_lab.flights.processes.interrupts import INTERRUPTED, Interrupts
from uam_lab.flights.progress import Progress
from uam_lab.records.results.terminal import Terminal, say
from uam_lab.report.page.console import reporting, summary
from uam_sim_bridge.faults.schedule import late

COMPLETED, NOT_COMPLETED = 0, 1


def add(command: Command) -> None:
    option = command.option
    text = "; ".join(f"{name}: {law.label}" for name, law in catalogue.LAWS.items())
    option("--controller", "NAME", text, catalogue.DEFAULT)
    text = (
        f"parameters: {', '.join(configuration.names('profiles'))}, or a ROS parameter file, as "
        "ros2 param dump writes it; may be repeated, a later one overrides (default: the "
        "controller's)"
    )
    option("--profile", "NAME|FILE", text, action="append")
    command.vehicle()
    command.scenario()
    command.described(
        FlightOptions,
        "end retime transit_speed transit_acceleration engine fused inner_rate clock imu plant",
    )
    command.plant()
    command.described(
        FlightOptions,
        "autopilot px4_dir px4_params arm dry_run sim_address gcs payload_mass",
    )
    wind = number("wind", "m/s")
    option("--wind", ("X", "Y", "Z"), "mean wind [m/s, ENU] (default: calm)", type=wind, nargs=3)
    text = "standard deviation of the gusts per axis (default: none)"
    option("--gust", "M/S", text, type=number("gust", "m/s", 0.0))
    text = "multiplies noise and bias of the sensors (default 1)"
    option("--noise", "FACTOR", text, type=number("noise", "", 0.0))
    milliseconds = number("delay", "ms", 0.0, 1000.0)
    for what, text in (
        ("setpoint", "messages to the autopilot"),
        ("mocap", "poses of the motion capture"),
    ):
        option(f"--{what}-delay", "MS", f"{text} arrive later", 0.0, type=milliseconds)
        text = "largest further delay of each message, uniform"
        option(f"--{what}-jitter", "MS", text, 0.0, type=milliseconds)
    command.seed("of all noise")
    command.described(FlightOptions, "without view faults")
    command.out("<scenario>-<controller>")
    command.described(FlightOptions, "log_limit")
    command.switch("--no-video", "leave out the video, which takes longest")
    command.switch("--no-report", "leave out the report with its video; uam report makes it later")
    command.described(FlightOptions, "instance")
    command.process()
    command.described(FlightOptions, "namespace domain")


def run(options: argparse.Namespace) -> int:
    given = {name: value for name, value in vars(options).items() if name not in ("command", "run")}
    given["process"] = chosen_process(given)
    delays = [
        1e-3 * given.pop(f"{what}_{kind}")
        for what in ("setpoint", "mocap")
        for kind in ("delay", "jitter")
    ]
    given["faults"] = [*given["faults"], *late(*delays)]
    video, report = given.pop("video"), given.pop("report")
    changes = {
        "air.wind": given.pop("wind"),
        "air.gust": given.pop("gust"),
        "sensors.noise_scale": given.pop("noise"),
    }
    changes = {name: value for name, value in changes.items() if value is not None}
    settings = flight_settings.settings(**given, vehicle_changes=changes, command=command_line())
    for line in (missed := missed_margins(settings)):
        say(f"note: {line}")
    settings = replace(settings, notes=settings.notes + missed)
    return fly(settings, video, report)


def missed_margins(settings: FlightSettings) -> tuple[str, ...]:
    """Return lines about margins that the vehicle of a flight lacks with its profile.

    The shipped vehicles with their own profiles have them; these flights begin without the model,
    which takes a second. Nodes of the user have no model.
    """
    profile, shipped = settings.profile, configuration.root()
    own = profile.name == settings.vehicle.profile(settings.controller)
    if settings.foreign or (own and settings.vehicle.file.is_relative_to(shipped)):
        return ()
    from uam_lab.experiments.margins.cases import missed

    return missed(profile, sorted({0.0, settings.payload_mass}))


def fly(
    settings: FlightSettings,
    video: bool,
    report: bool,
    engine: Engine | None = None,
    name: str = "fly",
    further: Callable[[Path], Iterable[str]] = lambda folder: (),
) -> int:
    """Fly and report; return the exit status. Raises one-line errors before the flight starts.

    engine: None for that of the settings; name: of the command; further: lines about a result
    folder, which follow the summary.
    """
    landing = settings.scenario.landing
    console = Terminal()
    with Progress(console, landing.end) as progress, Interrupts() as stop:
        flight = Flight(checked=settings, observer=progress, stop=stop, flown_by=engine)
        with contextlib.suppress(FlightFailed), flight:
            flight.wait()
    result, folder = flight.result, flight.folder
    if report and stop.impatient and result.metrics is not None:
        report = False
        result.outcome.notes.append(f"no report after a second Ctrl-C: uam report {folder}")
    return tell(console, settings, result, name, video, report, further(folder))


def tell(
    console: Terminal,
    settings: FlightSettings,
    result: FlightResult,
    name: str,
    video: bool,
    report: bool,
    further: Iterable[str] = (),
) -> int:
    """Make the report and print the result of a flight; return the exit status.

    name: of the command; further: lines that follow the summary.
    """
    outcome, metrics = result.outcome, result.metrics
    if metrics is not None:
        if report:
            # not before the flight: this import takes a second
            from uam_lab.report.build import build_report

            # after Ctrl-C it has figures, but no rendered pictures, which take long
            with reporting(console) as show:
                made = build_report(
                    result.folder, show, video=video, pictures=not outcome.interrupted
                )
            if made.problem:
                outcome.notes.append(made.problem)
        console.print(summary(metrics, result.folder))
    else:
        say(f"results: {result.folder}")
    for line in further:
        say(line)
    for note in outcome.notes:
        say(f"note: {note}")
    if outcome.failure:
        say(f"uam {name}: {outcome.failure}", error=True)
        for line in outcome.details:
            say(f"  | {line}", error=True)
    if outcome.interrupted:
        return INTERRUPTED
    if settings.dry_run:
        return NOT_COMPLETED if outcome.failure else COMPLETED
    return COMPLETED if result.completed else NOT_COMPLETED
