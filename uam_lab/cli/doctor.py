"""`uam doctor`: check installation, ports, rendering and autopilot link, with advice.

Check installation, ROS, ports, rendering, autopilot link and machine. With --autopilot, compare a
PX4's parameters with those that a vehicle needs (config/px4/vehicle.yaml).

examples:
  uam doctor                                    takes half a minute
  uam doctor --autopilot serial:/dev/ttyACM0:921600
  uam doctor --config my_lab.yaml               the devices of a lab file, too; no torque
  uam doctor --json > doctor.json               for a bug report

Exit status: 0 only OK and WARN: flights work; 1 at least one FAIL; 2 wrong use.
"""

import argparse

from rich.text import Text

from uam_lab.cli.command import Command
from uam_lab.flights.vehicle.lab_file import Lab, load_lab
from uam_lab.preflight.doctor.finding import Finding, Verdict
from uam_lab.preflight.doctor.run import as_json, examine, worst
from uam_lab.records.results.terminal import Terminal, say
from uam_sim_bridge.mavlink.transport.transport import ALLOWED, parse_url

FINE, BROKEN = 0, 1
STYLES = {Verdict.OK: "green", Verdict.WARN: "bold yellow", Verdict.FAIL: "bold red"}


def add(command: Command) -> None:
    command.config()
    text = f"check an autopilot there: {ALLOWED} (default: the lab file's)"
    command.option("--autopilot", "URL", text, "")
    command.switch("--json", "print JSON, for programs")


def run(options: argparse.Namespace) -> int:
    lab = None if options.config is None else load_lab(options.config)
    url = options.autopilot or (lab.autopilot if lab else "")
    if url:
        parse_url(url)
    return _show(url, lab, options.json)


def _show(url: str, lab: Lab | None, machine_readable: bool) -> int:
    """Print each finding at once, or all as JSON; return the exit status."""
    console, found = Terminal(), []
    last = ""
    for group, finding in examine(url, lab):
        found.append((group, finding))
        if machine_readable:
            continue
        if group != last:
            console.print(Text(f"\n{group}" if last else group, style="bold"))
            last = group
        _print(console, finding)
    verdict = worst(finding.verdict for _, finding in found)
    if machine_readable:
        say(as_json(found))
    else:
        counts = {v: sum(f.verdict is v for _, f in found) for v in Verdict}
        text = ", ".join(f"{count} {v.value}" for v, count in counts.items() if count)
        console.print(Text(f"\n{text}", style=STYLES[verdict]))
    return BROKEN if verdict is Verdict.FAIL else FINE


def _print(console: Terminal, finding: Finding) -> None:
    """Print one line with the finding and, if it is not OK, one line with advice."""
    line = Text.assemble(
        (f"  {finding.verdict.value:<5}", STYLES[finding.verdict]),
        f"{finding.check:<16} {finding.found}",
    )
    console.print(line, soft_wrap=True)
    if finding.advice:
        console.print(Text(f"{'':24}→ {finding.advice}", style="dim"), soft_wrap=True)
