"""`uam fly`: fly a scenario and write a result folder."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from rich.console import Console

from uam_control.laws import catalogue
from uam_control.mission import ScenarioError
from uam_control.profiles.profile import ProfileError
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError
from uam_lab.cli.vehicle_options import add_scenario, add_vehicle
from uam_lab.flight import settings as flight_settings
from uam_lab.flight.conclude import command_line, conclude
from uam_lab.flight.progress import Progress
from uam_lab.flight.settings import (
    LOG_LIMIT,
    ONLOOKERS,
    REPLACEABLE,
    FlightSettings,
    SettingsError,
)
from uam_lab.report.build import build_report
from uam_lab.report.page.console import reporting, summary
from uam_lab.results.result_folder import ResultFolder, ResultFolderError
from uam_sim_bridge.faults import FaultError
from uam_sim_bridge.mavlink.transport.transport import ALLOWED
from uam_sim_bridge.plant.engines import DEFAULT_PLANT, PLANTS, PlantError
from uam_sim_bridge.ports import INSTANCES, PortError
from uam_sim_bridge.px4.px4_installation import Px4Error

COMPLETED, NOT_COMPLETED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130
USER_ERRORS = (
    SettingsError,
    ScenarioError,
    ProfileError,
    ConfigurationError,
    PortError,
    Px4Error,
    ResultFolderError,
    FaultError,
    PlantError,
    VehicleError,
)

EXAMPLES = """\
examples:
  uam fly                                    the paper's mission, default profile
  uam fly --scenario hover --seed 7          another scenario, other noise
  uam fly --scenario path.csv --no-video     a trajectory from a file
  uam fly --profile mine.yaml --engine direct
  uam fly --autopilot px4 --px4-dir ~/PX4-Autopilot/build/px4_sitl_default
  uam fly --autopilot serial:/dev/ttyACM0:921600 --clock realtime --gcs udp:127.0.0.1:14550
  uam fly --view --clock realtime            monitor and tune in a browser
  uam fly --clock realtime                   paced by the wall clock, latency measured
  uam fly --without arm_controller           with your own arm controller: examples/
  uam fly --payload-mass 0.3 --wind 2 0 0    heavier payload, 2 m/s from the west
  uam fly --fault mocap_dropout@20+3         no motion capture from 20 s on, for 3 s
  uam fly --fault motor_loss@pick+1:motor=2,remaining=0.7

A trajectory has the columns t,px,py,pz,yaw,vx,vy,vz,ax,ay,az,dyaw (SI, ENU) and, if the arm is to
move, alpha_1,alpha_2. Exit status: 0 mission completed, 1 flown but not completed, 2 wrong use.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "fly",
        help="fly a scenario and write a result folder",
        description="Start every node, fly a scenario, write a result folder.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    profiles = ", ".join(configuration.names("profiles"))
    option = parser.add_argument
    option(
        "--controller",
        default=catalogue.DEFAULT,
        metavar="NAME",
        help="; ".join(f"{name}: {law.label}" for name, law in catalogue.LAWS.items())
        + " (default %(default)s)",
    )
    option(
        "--profile",
        metavar="NAME|FILE",
        action="append",
        help=f"parameters: {profiles}, or a ROS parameter file, as ros2 param dump writes it; "
        "may be repeated, a later one overrides (default: the controller's)",
    )
    add_vehicle(parser)
    add_scenario(parser)
    option(
        "--engine",
        default="ros",
        metavar="ros|direct",
        help="nodes and sockets, or one loop without them (default %(default)s)",
    )
    option(
        "--clock",
        default="lockstep",
        metavar="lockstep|realtime",
        help="simulated time, repeatable for the same seed; or the wall clock "
        "(default %(default)s)",
    )
    option(
        "--plant",
        default=DEFAULT_PLANT,
        metavar="NAME|MODULE:CLASS",
        help=f"physics engine: {', '.join(PLANTS)}, or a class of your own (default %(default)s)",
    )
    option(
        "--autopilot",
        default="builtin",
        metavar="builtin|px4|URL",
        help="the stand-in; PX4 in software; or the link of an autopilot that you started: "
        f"{ALLOWED}; serial: a flight controller in HITL mode (default %(default)s)",
    )
    option(
        "--px4-dir",
        metavar="DIR",
        help="PX4's build directory, with bin/px4 and etc/ (default: $PX4_SITL_DIR)",
    )
    option(
        "--gcs",
        default="",
        metavar="URL",
        help="ground station, as udp:127.0.0.1:14550 (default: none)",
    )
    option(
        "--payload-mass",
        type=_number("mass", "kg", 0.0),
        metavar="KG",
        help="default: the scenario's",
    )
    option(
        "--wind",
        type=_number("wind", "m/s"),
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="mean wind [m/s, ENU] (default: calm)",
    )
    option(
        "--gust",
        type=_number("gust", "m/s", 0.0),
        metavar="M/S",
        help="standard deviation of the gusts per axis (default: none)",
    )
    option(
        "--noise",
        type=_number("noise", "", 0.0),
        metavar="FACTOR",
        help="multiplies noise and bias of the sensors (default 1)",
    )
    option("--seed", type=_seed, default=1, metavar="N", help="of all noise (default %(default)s)")
    option(
        "--without",
        action="append",
        default=[],
        metavar="NODE",
        help=f"do not start this node, wait for yours of that name: {', '.join(REPLACEABLE)}; "
        f"or do not start a display: {', '.join(ONLOOKERS)}; may be repeated",
    )
    option(
        "--view",
        action="store_true",
        help="serve the cockpit, a local web page: the scene, charts, gains, commands",
    )
    option(
        "--fault",
        action="append",
        default=[],
        metavar="SPEC|FILE",
        help="inject a fault: NAME@SECONDS[+DURATION] or NAME@PHASE[+AFTER[+DURATION]], then "
        ":parameter=value,...; or a YAML file with several faults; may be repeated; "
        "uam faults --list shows all faults",
    )
    option(
        "--out",
        type=Path,
        metavar="DIR",
        help="result folder (default results/<time>-<scenario>-<controller>)",
    )
    option(
        "--log-limit",
        type=_number("size", "MB", 1.0),
        default=LOG_LIMIT,
        metavar="MB",
        help="size at which log.mcap ends; the flight continues (default %(default)g, hours)",
    )
    option("--no-video", action="store_true", help="leave out the video, which takes longest")
    option(
        "--instance",
        type=int,
        metavar="N",
        help=f"ROS domain and ports of this instance, 0..{INSTANCES - 1}, numbered as PX4 does "
        "(default: the first free one)",
    )
    parser.set_defaults(run=run)


def _number(name: str, unit: str, low: float = -math.inf):
    """Return an argparse type: a finite number, at least `low`."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or value < low:
            least = f", at least {low:g}" if low > -math.inf else ""
            raise argparse.ArgumentTypeError(
                f"'{text}' is not a {name}: a number{f' in {unit}' if unit else ''}{least}"
            )
        return value

    return read


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is not a seed: a whole number, 0 or more")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    try:
        settings = flight_settings.settings(
            scenario=options.scenario,
            controller=options.controller,
            profile=options.profile,
            vehicle=options.vehicle,
            engine=options.engine,
            clock=options.clock,
            plant=options.plant,
            autopilot=options.autopilot,
            px4_dir=options.px4_dir,
            gcs=options.gcs,
            payload_mass=options.payload_mass,
            seed=options.seed,
            out=options.out,
            video=not options.no_video,
            vehicle_changes=_vehicle_changes(options),
            instance=options.instance,
            without=options.without,
            log_limit=options.log_limit,
            view=options.view,
            faults=options.fault,
        )
        return fly(settings)
    except USER_ERRORS as error:
        print(f"uam fly: {error}", file=sys.stderr)
        return WRONG_USE


def _vehicle_changes(options: argparse.Namespace) -> dict[str, object]:
    changes = {
        "air.wind": options.wind,
        "air.gust": options.gust,
        "sensors.noise_scale": options.noise,
    }
    return {name: value for name, value in changes.items() if value is not None}


def fly(settings: FlightSettings) -> int:
    """Fly and report; return the exit status. Raises USER_ERRORS before the flight starts."""
    engine = _engine(settings.engine)
    folder = ResultFolder.create(settings.scenario.name, settings.controller, settings.out)
    landing = settings.scenario.landing
    console = Console()
    with Progress(console, landing.at + landing.duration) as progress:
        try:
            outcome = engine(settings, folder, progress)
        except USER_ERRORS:
            _remove_if_empty(folder.path)
            raise
    metrics = conclude(settings, folder, outcome, command_line())
    if metrics is not None:
        # after Ctrl-C the report has figures, but no rendered pictures, which take long
        with reporting(console) as show:
            report = build_report(
                folder.path, show, video=settings.video, pictures=not outcome.interrupted
            )
        if report.problem:
            outcome.notes.append(report.problem)
        console.print(summary(metrics, folder.path))
    else:
        print(f"results: {folder.path}")
    for note in outcome.notes:
        print(f"note: {note}")
    if outcome.failure:
        print(f"uam fly: {outcome.failure}", file=sys.stderr)
        for line in outcome.details:
            print(f"  | {line}", file=sys.stderr)
    if outcome.interrupted:
        return INTERRUPTED
    completed = metrics is not None and metrics["mission_completed"] and not outcome.failure
    return COMPLETED if completed else NOT_COMPLETED


def _engine(name: str):
    """Return the engine's `fly`. Raises SettingsError if ROS is not installed."""
    if name == "direct":
        from uam_lab.flight.direct.engine import fly as engine

        return engine
    flight_settings.require_ros()
    from uam_lab.flight.ros.engine import fly as engine

    return engine


def _remove_if_empty(folder: Path) -> None:
    """Remove the empty result folder of a refused flight."""
    for path in (folder / "logs", folder):
        try:
            path.rmdir()
        except OSError:
            return
