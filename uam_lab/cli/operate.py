"""`uam start`, `hold`, `resume`, `land`, `disarm`, `kill`, `goto`, `status`, `preflight`."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from uam_control.settings.texts import visible
from uam_lab.cli.command import Command, guest_of, number
from uam_lab.records.results.terminal import say

if TYPE_CHECKING:
    from uam_lab.flights.operator import Operator

DONE, REFUSED = 0, 1
WHAT = {
    "start": ("arm and take off", "Arm and take off, if the pre-arm report is green."),
    "hold": ("stop on the path", "Stop on the path and hold the position."),
    "resume": (
        "go on after a hold",
        "Continue on the path after a hold. After the pilot or a failsafe took over: request\n"
        "OFFBOARD, then continue from the present position.",
    ),
    "land": ("land here", "Descend vertically and disarm."),
    "disarm": ("motors off", "Motors off: on the ground, or in failsafe."),
    "kill": (
        "stop the motors at once, in the air too",
        "Stop the motors at once: a vehicle in the air falls. Asks first.",
    ),
    "goto": (
        "fly to a position",
        "Fly to a position [m, ENU] and hold it there: the base, or the hand (end effector).",
    ),
    "status": ("phase, errors, who has control", "Show the flight."),
    "preflight": (
        "the pre-arm report",
        "Show every check before arming with value and limit. Exit status 1 if one fails.",
    ),
}
PLACES = """\
  uam goto 0.5 0 1.2 --yaw 90         turn north; without --yaw the heading stays
  uam goto 0.5 0 0                    keep the height
  uam goto --hand 0.5 0 0.8           bring the hand there, base and arm together
"""
PAGE = """\
`uam {0}`: {1}.

{2}

examples:
{3}\
  uam {4}                            the flight that runs
  uam {4} --instance 2               one of several flights
  uam {4} --namespace uav1           the same, by the namespace of its nodes
  ROS_DOMAIN_ID=5 uam {4} --namespace uav1   nodes that uam fly did not start

Exit status: 0 accepted, 1 refused (the reason is printed), 2 no flight or wrong use.
"""


def page(name: str) -> str:
    """Return the help of a command."""
    examples = (PLACES, "goto 0.5 0 1.2") if name == "goto" else ("", name)
    return PAGE.format(name, *WHAT[name], *examples)


def add(command: Command) -> None:
    command.instance()
    if command.name == "kill":
        command.switch("--yes", "do not ask")
    if command.name != "goto":
        return
    for axis, text in (("x", "[m]"), ("y", "[m]"), ("z", "[m]; 0: as it is, of the base")):
        command.option(axis, axis.upper(), text, type=number("coordinate", "m"))
    text = "heading (default: as it is)"
    command.option("--yaw", "DEGREES", text, type=number("heading", "degrees"))
    command.switch("--hand", "position and heading of the end effector")


def run(options: argparse.Namespace) -> int:
    with guest_of(options) as guest:
        from uam_lab.flights.operator import Operator

        return ACTS.get(options.command, _send)(Operator(guest.node), options)


def _send(operator: Operator, options: argparse.Namespace) -> int:
    return _said(options.command, *operator.command(options.command))


def _kill(operator: Operator, options: argparse.Namespace) -> int:
    if not options.yes:
        say(
            f"{operator.place}: the motors stop at once; a vehicle in the air falls. "
            "Type kill to confirm: ",
            end="",
        )
        typed = sys.stdin.readline()
        if not typed.endswith("\n"):  # the end of a file or pipe
            say()
        if typed.strip() != "kill":
            return _said("kill", False, "not confirmed, nothing was sent")
    return _said("kill", *operator.kill())


def _goto(operator: Operator, options: argparse.Namespace) -> int:
    yaw = math.nan if options.yaw is None else math.radians(options.yaw)
    place = options.x, options.y, options.z
    return _said("goto", *operator.goto(*place, yaw, options.hand))


def _status(operator: Operator, _: argparse.Namespace) -> int:
    mission, autopilot = operator.mission(), operator.autopilot()
    time = "before take-off" if mission.time < 0.0 else f"{mission.time:.1f} s"
    rows = {
        "phase": f"{mission.phase}, {time}",
        "state": f"{mission.state}: {mission.cause}",
        "control": autopilot.released_to or ("companion" if autopilot.armed else "nobody"),
        "autopilot": autopilot.summary,
        "errors": f"{mission.position_error:.3f} m, "
        f"attitude {math.degrees(mission.attitude_error):.2f} deg, "
        f"arm {math.degrees(mission.arm_error):.2f} deg",
        "tilt": f"{math.degrees(mission.tilt):.2f} deg",
    }
    if mission.setpoint_delay is not None and mission.delay_margin is not None:
        late, margin = 1e3 * mission.setpoint_delay, 1e3 * mission.delay_margin
        rows["delay"] = f"setpoints {late:.1f} ms late, margin {margin:.1f} ms"
    if mission.abort_reason:
        rows["aborted"] = mission.abort_reason
    if autopilot.reasons:
        rows["reasons"] = autopilot.reasons
    for name, text in rows.items():
        say(f"{name:<10} {visible(text)}")
    return DONE


def _preflight(operator: Operator, _: argparse.Namespace) -> int:
    mission = operator.mission()
    if mission.time >= 0.0 and not mission.done:  # the newest report is that before the take-off
        since = f"{mission.state}, {mission.time:.1f} s since the take-off"
        return _said("preflight", False, f"{since}: there is no report in flight")
    checks = operator.preflight()
    width = max((len(check.name) for check in checks), default=0)
    for check in checks:
        mark = "ok  " if check.passed else "FAIL"
        say(visible(f"{mark} {check.name:<{width}}  {check.value:<16} {check.limit}"))
    failed = [check.name for check in checks if not check.passed]
    say(visible(f"not ready: {', '.join(failed)}" if failed else "ready to start"))
    return REFUSED if failed else DONE


def _said(name: str, accepted: bool, text: str) -> int:
    say(f"{name}: {visible(text)}", error=not accepted)
    return DONE if accepted else REFUSED


ACTS = {"kill": _kill, "goto": _goto, "status": _status, "preflight": _preflight}
