"""`uam margins`: delay, gain and phase margin and bandwidth of every loop.

Linearise the objects that fly around hover and compute the margins of each loop: attitude,
position, joints.

examples:
  uam margins                              default profile: without payload and with 0.2 kg
  uam margins --profile s500 --profile mine.yaml      mine.yaml overrides
  uam margins --payload 0 --payload 0.4    other payloads
  uam margins --delay 16                   with setpoints that come 16 ms later
  uam margins --flight results/latest      adapted gains of a flight (default: one is flown)
  uam margins --initial                    only the initial gains; no flight

The model is linear, around hover; docs/tuning.md. Results in --out: margins.md, margins.json,
bode.png, step.png. Exit status: 0 every case is stable, 1 one is not, 2 wrong use.
"""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_control.mission import load_scenario
from uam_control.profiles.profile import Profile
from uam_control.vehicle import load_description
from uam_lab.cli.command import Command, given_profile, number, path
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say

STABLE, UNSTABLE = 0, 1


def add(command: Command) -> None:
    command.profile()
    command.vehicle()
    command.scenario()
    mass = number("mass", "kg", 0.0)
    command.repeated("--payload", "KG", "payload on the magnet (default: 0 and 0.2)", type=mass)
    angle = number("angle", "rad")
    command.option("--arm", "RAD", "angles of the joints (default: stowed)", type=angle, nargs="+")
    text = "delay added to the setpoints, in whole control periods"
    command.option("--delay", "MS", text, 0.0, type=number("delay", "ms", 0.0, 200.0))
    text = "result folder of a flight with the adapted gains (default: --scenario is flown)"
    command.option("--flight", "DIR", text, type=path)
    command.switch("--initial", "only the initial gains of the profile")
    command.out()


def run(options: argparse.Namespace) -> int:
    from uam_lab.experiments.margins import report
    from uam_lab.experiments.margins.cases import cases_of, flown_gains, smallest_delay, verdict
    from uam_lab.experiments.margins.pose_delay import pose_delay
    from uam_lab.experiments.margins.stack_model import MODELLED
    from uam_lab.experiments.trials.trial import Trial, recorded
    from uam_lab.records.rebuild import series_of
    from uam_sim_bridge.plant import Vehicle

    described = load_description(options.vehicle)
    profile = given_profile(options.profile, described)
    vehicle = Vehicle.of(described)
    joints = len(described.joints)
    if options.arm is not None and len(options.arm) != joints:
        raise SettingsError(f"--arm: {len(options.arm)} angles, the vehicle has {joints} joints")
    for joint, angle in zip(described.joints, options.arm or (), strict=False):
        if not joint.low <= angle <= joint.high:
            allowed = f"{joint.low:.2f} to {joint.high:.2f} rad"
            raise SettingsError(f"--arm: {joint.name} {angle:g} is outside {allowed}")
    if profile.setpoint not in MODELLED:
        known = " or ".join(MODELLED)
        raise SettingsError(f"{profile.name}: margins need setpoint: {known}")
    payloads = options.payload or [0.0, 0.2]
    series = None
    if options.flight and not options.initial:
        series = series_of(options.flight)
        _check_flown(options.flight, series.info, profile)
    out = make_folder(options.out, "margins")  # before the flight, which takes long
    flown = None
    if not options.initial:
        if series is None:
            mass = load_scenario(options.scenario, described).payload_mass
            series = recorded(Trial("margins", profile, mass, 1, options.scenario)).series
        flown = flown_gains(profile, series)
    ticks = round(1e-3 * options.delay / described.control_period)
    cases = cases_of(profile, vehicle, payloads, flown, options.arm, ticks)
    mocap = described.numbers["sensors"]["mocap"]
    period = described.control_period
    oldest = pose_delay(profile.sets["state_estimator"], period, mocap["rate"])
    left = oldest - mocap["latency_ticks"] * period
    stated = profile.sets["mission"].delay_margin
    facts = {
        "mocap_delay_s": left,
        "delay_margin_of_the_profile_s": stated,
        "profile": profile.name,
        "vehicle": described.name,
        "added_delay_s": ticks * described.control_period,
        "command": command_line(),
        "made": time.strftime("%Y-%m-%dT%H:%M:%S"),
    }
    report.write(out, cases, facts)
    say(f"{profile.name} on {described.name}, hover, linear")
    say(report.table(cases))
    say(f"Poses may come {1e3 * left:.0f} ms later, then the estimate oscillates.")
    computed = smallest_delay(cases)[0]
    say(f"The supervisor has delay_margin: {stated:g} ({verdict(stated, computed)}).")
    say(f"results  {out}")
    return STABLE if all(case.analysis.stable for case in cases) else UNSTABLE


def _check_flown(folder: Path, info: Mapping[str, Any], profile: Profile) -> None:
    """Refuse a flight of another law or vehicle: its gains are not those of the profile."""
    law = info.get("controller", "")
    if law in catalogue.LAWS and law not in profile.laws().values():
        raise SettingsError(f"--flight {folder}: flown by the law {law}: give its --profile")
    vehicle = Path(info.get("vehicle") or profile.vehicle.source).stem
    if vehicle != profile.vehicle.name:
        raise SettingsError(f"--flight {folder}: flown by {vehicle}: give its --vehicle")
