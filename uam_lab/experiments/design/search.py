"""Design of autopilot gains and profile: closed formulas, then the margins of the linear model.

Each loop has one bandwidth. It begins at what lags, noise and torques allow, and is made smaller
by STEP until `uam margins`' model has the margins of the criteria at every pose of the arm and with
the payload; that of a joint larger, where its gain may not fall enough: an upright link falls over.
All loops are judged together, because each closes around the others.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import yaml

from uam_control.coordinates import PITCH, ROLL, YAW, Z
from uam_control.estimation import EstimatorParameters
from uam_control.profiles.profile import Profile, ProfileError, profile_of
from uam_control.settings.atomic import write_text
from uam_control.settings.parameter_file import as_text
from uam_control.vehicle import AUTOPILOT_FILE, PROFILE_FILE, VehicleDescription, chain_of, designed
from uam_lab.experiments.design.criteria import DesignError
from uam_lab.experiments.design.facts import Facts, standing_torque
from uam_lab.experiments.design.gains import (
    Bandwidths,
    autopilot_gains,
    estimator,
    rate_loop,
    sections,
    thrust_response,
)
from uam_lab.experiments.margins import report
from uam_lab.experiments.margins.cases import Case
from uam_lab.experiments.margins.linear import Margins
from uam_lab.experiments.margins.loops import GROWTH, Analysis, analyse, fastest_mode
from uam_lab.experiments.margins.stack_model import Stack, stack_model
from uam_lab.records.results.templates import markdown_table, shown
from uam_lab.report.figures import style
from uam_sim_bridge.plant import Vehicle

STEP, ROUNDS = 0.92, 40
BRAKED, BRAKED_SPEED = 0.5, 1.0  # of the effort limit that friction may take, at [rad/s]
RATES = "rate loop"
OBSERVED = 0.23  # periods of its bandwidth, by which the observer's velocity of a joint is late
ROUND_DOWN = 1e3  # the profile's delay margin is a whole number of milliseconds


class Fault(NamedTuple):
    """Why a loop's bandwidth must change, and by which factor."""

    why: str
    factor: float = STEP


@dataclass(frozen=True)
class Design:
    """A designed vehicle."""

    described: VehicleDescription  # with the designed gains of the autopilot
    profile: Profile  # for it
    cases: tuple[Case, ...]  # the analysed operating points
    faults: dict[str, Fault]  # loop → why its bandwidth must change, {} of one with all margins
    limits: dict[str, str] = field(default_factory=dict)  # loop → what keeps it from being faster

    @property
    def summary(self) -> str:
        """Return the faults in one line."""
        return "; ".join(f"{loop}: {f.why}" for loop, f in self.faults.items()) or "margins are met"


def design(
    described: VehicleDescription,
    criteria: SimpleNamespace,
    progress: Callable[[str], None] = lambda _: None,
) -> Design:
    """Return the design of a vehicle; progress: called with a line per round.

    Raises DesignError, and VehicleError if the MJCF contradicts the description.
    """
    search = Search(described, criteria)
    tried: set[tuple[object, str]] = set()
    before = ""
    for number in range(1, ROUNDS + 1):
        try:
            found = search.evaluated()
        except ProfileError as error:  # a gain below what a profile may have: slower does not help
            raise DesignError(f"{described.name}: no gains: {error}") from None
        progress(f"round {number}: {found.summary}")
        if not found.faults:
            return search.result(found)
        if (step := (search.shares, found.summary)) in tried:
            both = f"{before}, or {found.summary}"
            raise DesignError(f"{described.name}: no gains keep all margins: {both}; --criteria")
        tried.add(step)
        before = found.summary
        search.mend(found.faults)
    raise DesignError(
        f"{described.name}: no gains within {number} rounds: {found.summary}; --criteria"
    )


class Search:
    """The bandwidths of a vehicle, and what limits them."""

    def __init__(self, described: VehicleDescription, criteria: SimpleNamespace) -> None:
        self._described, self._criteria = described, criteria
        vehicle = Vehicle.of(described)
        self.facts = Facts.of(vehicle)
        names = described.coordinates
        self._shares = dict.fromkeys((RATES, *names), 1.0)
        self._limits: dict[str, str] = {}
        poses, mass = self.facts.poses, criteria.payload * described.mass
        loaded = (f"stowed, {mass:.2g} kg", poses["stowed"], mass)
        # label, joint angles and payload [kg] of each operating point
        self._points = [*((name, arm, 0.0) for name, arm in poses.items()), loaded]
        self._refuse_unbalanced(vehicle)
        self._refuse_braked()

    @property
    def shares(self) -> tuple[float, ...]:
        """Return the share of each loop in what the formulas allow, to ten digits."""
        return tuple(round(share, 10) for share in self._shares.values())

    def _refuse_unbalanced(self, vehicle: Vehicle) -> None:
        """Raise DesignError where level hover takes all torque that the attitude law may give."""
        described = self._described
        allowed = np.array(self._criteria.authority.torque) * self.facts.torque
        for label, arm, mass in self._points:
            weight = (described.mass + mass) * described.gravity
            # what is fed forward is that of the vehicle alone, at the thrust that carries both
            fed = standing_torque(vehicle, arm) * (1.0 + mass / described.mass)
            needed = np.maximum(np.abs(fed), np.abs(standing_torque(vehicle, arm, mass)))
            for name, along, one, most in zip(
                ("roll", "pitch"), "yx", needed, allowed, strict=False
            ):
                if one >= most:
                    angles = ", ".join(f"{angle:.0f}" for angle in np.degrees(arm))
                    raise DesignError(
                        f"{described.name}: {label}, arm at {angles} deg: level hover needs "
                        f"{one:.3g} N m in {name}, the attitude controller may give {most:.3g}: "
                        f"the centre of mass is {1e3 * one / weight:.1f} mm from the middle of the "
                        f"rotors along {along}, {1e3 * most / weight:.1f} mm are possible: a "
                        "centre nearer to it, a lighter arm or one of a smaller range, or rotors "
                        "farther out or stronger"
                    )

    def _refuse_braked(self) -> None:
        """Raise DesignError where friction takes more than BRAKED of a servo's torque."""
        described, chain = self._described, chain_of(self._described)
        for i, (joint, servo) in enumerate(zip(described.joints, described.servos, strict=True)):
            lost = float(chain.friction[i] + BRAKED_SPEED * chain.damping[i])
            if lost > BRAKED * servo.effort_limit:
                raise DesignError(
                    f"{described.name}: {joint.name}: friction {chain.friction[i]:g} N m, damping "
                    f"{chain.damping[i]:g} N m s/rad of {described.model.name} take {lost:.2g} N m "
                    f"at {BRAKED_SPEED:g} rad/s, of {servo.effort_limit:g} N m; "
                    f"{100 * BRAKED:g} % are possible: a stronger servo"
                )

    def bandwidths(self) -> Bandwidths:
        """Return the bandwidths: what the formulas allow, times the share of each loop."""
        c, facts, described = self._criteria, self.facts, self._described
        names = described.coordinates
        rates = tuple(rate_loop(facts, i, c, self._shares[RATES]) for i in range(YAW - ROLL + 1))
        share = np.array([self._shares[name] for name in names])
        attitude = c.attitude * np.array([one.bandwidth for one in rates]) * share[ROLL : YAW + 1]
        for name, loop in zip(names[ROLL:], rates, strict=False):
            self._limits.setdefault(name, loop.limit)
        position, arm = self._position(attitude), self._arm()
        return Bandwidths(rates, attitude, position * share[:ROLL], arm * share[YAW + 1 :])

    def _position(self, attitude: np.ndarray) -> np.ndarray:
        c, facts, described = self._criteria, self.facts, self._described
        names = described.coordinates
        seen = c.estimate * estimator(described, c)["position_bandwidth"]
        across = c.horizontal * float(attitude[: YAW - ROLL].min())
        lag = thrust_response(described, facts, c) or facts.lag[0]
        room = c.authority.thrust * described.full_thrust / described.mass - described.gravity
        vertical = {
            "rotor lag": c.vertical / (lag + facts.seen),
            "estimator": seen,
            "thrust": math.sqrt(max(room, 0.1) / (c.saturation.height * c.feedback.stiffness)),
        }
        slowest = min(vertical, key=vertical.__getitem__)
        self._limits.setdefault(names[Z], slowest)
        for name in names[:Z]:
            self._limits.setdefault(name, "attitude" if across < seen else "estimator")
        return np.array([min(across, seen), min(across, seen), vertical[slowest]])

    def _arm(self) -> np.ndarray:
        c, facts, described = self._criteria, self.facts, self._described
        age = facts.bus + OBSERVED / EstimatorParameters().joint_observer_bandwidth
        late = c.joint / age
        torques = c.authority.servo * facts.servo
        strong = np.sqrt(torques / (c.feedback.stiffness * c.saturation.joint * facts.joints))
        for name, one, torque in zip(
            described.coordinates[YAW + 1 :], strong, torques, strict=True
        ):
            text = f"samples and commands {1e3 * age:.0f} ms late"
            self._limits.setdefault(name, text if late < one else f"torque {torque:.2g} N m")
        return np.minimum(late, strong)

    def evaluated(self) -> Design:
        """Return the margins with the present bandwidths."""
        bandwidths = self.bandwidths()
        gains = self._described.autopilot_gains | autopilot_gains(bandwidths)
        described = replace(self._described, autopilot_gains=gains)
        own = sections(described, self.facts, bandwidths, self._criteria)
        profile = profile_of(own, Path(f"{described.name}_profile.yaml"), described)
        vehicle, cases = Vehicle.of(described), []
        for point in list(self._points):
            label, arm, mass = point
            stack = stack_model(profile, vehicle, mass, arm)
            analysis = analyse(stack)
            cases.append(Case(label, stack, analysis, {}, analysis.mode))
            if faults := self._failing(stack, analysis):
                # the hardest point first: others are looked at once it has its margins
                self._points.remove(point)
                self._points.insert(0, point)
                named = {
                    loop: one._replace(why=f"{one.why}, {label}") for loop, one in faults.items()
                }
                return Design(described, profile, tuple(cases), named)
        return Design(described, profile, tuple(cases), {})

    def _failing(self, stack: Stack, analysis: Analysis) -> dict[str, Fault]:
        wanted, found = self._criteria.margins, {}
        joints = stack.coordinates[YAW + 1 :]
        for loop, (_, margins) in analysis.loops.items():
            if fault := shortfall(margins, wanted, loop in joints):
                found[loop] = fault
        if analysis.setpoint_delay < wanted.delay:
            base = [name for name in analysis.loops if name in stack.coordinates[: YAW + 1]]
            worst = min(base, key=lambda name: analysis.loops[name][1].delay)
            found.setdefault(worst, Fault(f"delay margin {1e3 * analysis.setpoint_delay:.0f} ms"))
        # what is wrong with the rate loop shows in all loops around it: it is mended first
        factor = 10.0 ** (wanted.gain / 20.0)
        if not found or {*stack.coordinates[ROLL:YAW]} & {*found}:
            up, down = (
                fastest_mode(scaled_motors(stack, one)).growth < GROWTH
                for one in (factor, 1.0 / factor)
            )
            # where less of the motors does not help an unstable vehicle, the fault is elsewhere
            if not up and (analysis.stable or down):
                return {RATES: Fault("gain margin of all motors up")}
            if analysis.stable and not down:
                return {stack.coordinates[ROLL]: Fault("gain margin of all motors down")}
        if not analysis.stable and not found:
            found = dict.fromkeys(self._shares, Fault("unstable"))
        return found

    def mend(self, faults: dict[str, Fault]) -> None:
        """Change the bandwidths of these loops; roll and pitch, and x and y, stay alike."""
        names = self._described.coordinates
        factors = {loop: fault.factor for loop, fault in faults.items()}
        for pair in (names[ROLL], names[PITCH]), names[:Z]:
            if {*pair} & {*faults}:
                factors |= dict.fromkeys(pair, STEP)
        for loop, factor in factors.items():
            self._shares[loop] *= factor
        for loop, fault in faults.items():
            self._limits[loop] = fault.why

    def result(self, found: Design) -> Design:
        """Return the design; its profile has the delay margin of the cases."""
        least = min(case.analysis.setpoint_delay for case in found.cases)
        margin = min(1.0, math.floor(ROUND_DOWN * least) / ROUND_DOWN)
        profile = found.profile.changed(found.profile.name, {"mission": {"delay_margin": margin}})
        return replace(found, profile=profile, limits=dict(self._limits))


def shortfall(margins: Margins, wanted: SimpleNamespace, joint: bool) -> Fault | None:
    """Return the margin of a loop that is below the wanted one; None: all are met."""
    if joint and margins.gain_down < min(wanted.gain, margins.gain):
        return Fault(f"gain margin down {margins.gain_down:.1f} dB", 1.0 / STEP)
    if margins.delay < wanted.delay:
        return Fault(f"delay margin {1e3 * margins.delay:.0f} ms")
    least = min(margins.gain, margins.gain_down)
    if least < wanted.gain:
        return Fault(f"gain margin {least:.1f} dB")
    return Fault(f"sensitivity {margins.peak:.2f}") if margins.peak > wanted.peak else None


def scaled_motors(stack: Stack, factor: float) -> Stack:
    """Return the stack whose motors are commanded `factor` times the change."""
    blocks: list[Any] = []
    for block in stack.blocks:
        if block.outputs[0].startswith("motor."):
            block = replace(block, c=factor * block.c, d=factor * block.d)
        blocks.append(block)
    return replace(stack, blocks=tuple(blocks))


MADE = "# uam vehicle design"  # first words of a file that a later design may replace
PICTURES = (("bode", report.bode), ("step", report.steps))
HEAD = ("loop", "crossover rad/s", "phase deg", "gain dB", "delay ms", "peak", "limited by")


def files_of(described: VehicleDescription, folder: Path) -> dict[str, Path]:
    """Return profile, autopilot and pictures of a vehicle's design in `folder`, by kind.

    Raises DesignError for one that is there and was written by hand.
    """
    found = {
        kind: folder / designed(described.file, kind).name
        for kind in (PROFILE_FILE, AUTOPILOT_FILE)
    }
    for file in found.values():
        if file.exists() and not file.read_text(encoding="utf-8").startswith(MADE):
            raise DesignError(f"{file} is not a design's: --out writes to another folder")
    return found | {name: folder / f"{described.file.stem}_{name}.png" for name, _ in PICTURES}


def write(made: Design, files: Mapping[str, Path]) -> None:
    """Write the files of `files_of`."""
    head = f"{MADE} {made.described.file.name}\n"
    limits = "".join(f"# {loop}: {why}\n" for loop, why in made.limits.items())
    lines = head + "# what keeps each loop from being faster:\n" + limits
    write_text(files[PROFILE_FILE], lines + as_text(made.profile.sections))
    gains = yaml.safe_dump(made.described.autopilot_gains, sort_keys=False)
    write_text(files[AUTOPILOT_FILE], head + gains)
    with style.styled():
        for name, draw in PICTURES:
            style.save(draw(made.cases), files[name])


def table(made: Design) -> str:
    """Return the table in Markdown, the least margins over all operating points of the design."""
    found = [case.analysis for case in made.cases]
    delay = 1e3 * min(one.setpoint_delay for one in found)
    name, labels = made.described.name, ", ".join(case.label for case in made.cases)
    return "\n\n".join(
        [
            f"{name}, hover, linear; least margins of: {labels}",
            markdown_table(HEAD, _rows(made)),
            f"setpoints may come {delay:.0f} ms later",
        ]
    )


def _rows(made: Design) -> Iterator[list[str]]:
    for loop in made.cases[0].analysis.loops:
        seen = [case.analysis.loops[loop][1] for case in made.cases]
        yield [
            loop,
            f"{min(one.crossover for one in seen):.3g}",
            f"{min(abs(one.phase) for one in seen):.0f}",
            shown(min(min(one.gain, one.gain_down) for one in seen), 1),
            shown(1e3 * min(one.delay for one in seen), 0),
            f"{max(one.peak for one in seen):.2f}",
            made.limits[loop],
        ]
    if RATES in made.limits:
        yield [RATES, "", "", "", "", "", made.limits[RATES]]
