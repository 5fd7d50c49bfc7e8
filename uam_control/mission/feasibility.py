"""Whether a vehicle can fly a reference, before it takes off: what exceeds a limit, and when."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np

from uam_control.arm.hand import hinge_angles
from uam_control.coordinates import CHI, POSITION, ROLL, YAW, X, Y, Z
from uam_control.mission.demand import STEP, Demand, Excess, Needs
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios.ramps import within_room
from uam_control.mission.scenarios.route import RUN_OUT, RUN_UP, TRAJECTORY
from uam_control.mission.scenarios.scenario import STANDING, Scenario, ScenarioError
from uam_control.mission.scenarios.scenario_options import SLOWEST
from uam_control.vehicle import NO_GRIPPER, VehicleDescription

PART = 60000  # checks in one part of a long flight
BESIDE = 4  # further ones on both sides of a part: second derivatives there are those of the whole
CRAWL = 0.05  # [m/s] across: a vehicle that still stands on its gear turns over
HARD = 1.0  # [m/s] sink rate at the ground that damages the gear
# Of the full thrust: a limit above the first is not this vehicle's, the second replaces it. Rotors
# at their limit cannot turn the vehicle; with the second they still can.
LARGEST, USABLE = 0.97, 0.85
THRUST = "thrust"
ROUNDING = 1e-6  # [SI]
DRAGGED = "height while it moves across"
ACROSS = ("x", "y", "yaw")
PRECISION = 1e-3  # of the slowdown, relative
ROOM = 1.002  # by which the slowdown is larger than the least one found
USED = 0.8  # of thrust, tilt and rates by a run-up that is long enough
CLEAR = 0.2  # [m] of a ramp from the geofence and the ground


class InfeasibleReference(ScenarioError):
    """A reference that exceeds a limit; the text is one line: what, which limit, when."""


@dataclass(frozen=True)
class Feasibility:
    """The check of references for one vehicle with its limits."""

    vehicle: VehicleDescription
    limits: MissionParameters
    payload_mass: float  # [kg] carried while the scenario's magnet is on
    reserve: float = 0.0  # share of the thrust beyond the weight that a reference leaves free

    def excesses(self, scenario: Scenario) -> list[Excess]:
        """Return every limit that the scenario exceeds on a flight from the origin, the earliest
        first."""
        return self.examined(scenario)[0]

    def examined(self, scenario: Scenario) -> tuple[list[Excess], float]:
        """Return the `excesses`, and the delay of the setpoints [s] that the reference stands.

        A flight of many hours is computed in parts, so that its memory is bounded.
        """
        (begun, trajectory), turn = scenario.from_origin(), 0.0
        times = np.arange(0.0, begun.landing.end, STEP)
        found: dict[tuple, Excess] = {}
        legs: dict[str, dict[tuple, Excess]] = {RUN_UP: {}, TRAJECTORY: {}, RUN_OUT: {}}
        for begin in range(0, len(times), PART):
            part = slice(max(begin - BESIDE, 0), begin + PART + BESIDE)
            demand = self.needs.along(trajectory, times[part], self.carried(begun, times[part]))
            demand = demand.within(slice(begin - part.start, begin - part.start + PART))
            turn = max(turn, float(demand.turn.max()))
            if not self._collect(demand, STANDING, found):
                continue
            phases = np.array([begun.phase(time) for time in demand.times])
            for leg, excesses in legs.items():
                if (phases == leg).sum() > 1:
                    self._collect(demand.within(phases == leg), STANDING, excesses)
        for leg in (RUN_UP, RUN_OUT):  # where the ramp is the reason, it is named
            for key in legs[leg].keys() - legs[TRAJECTORY].keys():
                found.pop(key, None)
                found[*key, leg] = legs[leg][key]._replace(ramp=leg)
        return sorted(found.values(), key=lambda excess: excess.first), self.limits.delay_of(turn)

    def _collect(self, demand: Demand, ground: float, found: dict) -> bool:
        """Add what a demand exceeds to `found`, the worst of each limit; return whether it does."""
        exceeded = self.exceeded(demand, ground)
        for one in exceeded:
            key = one.quantity, one.limit
            known = found.get(key, one)
            worst = max(known, one, key=attrgetter("beyond"))
            found[key] = worst._replace(first=known.first)
        return bool(exceeded)

    def from_place(self, scenario: Scenario, start: np.ndarray) -> list[Excess]:
        """Return what the first moves across exceed on a flight from chi start (6 + n,).

        A route has a way there, whose length fits. Moves have fixed times: from a place far from
        the first one's end they are hard. [] within all limits.
        """
        first: dict[str, float] = {}
        for move in sorted(scenario.moves, key=lambda one: one.start):
            if move.coordinate in ACROSS:
                first.setdefault(move.coordinate, move.end)
        if not first:
            return []
        times = np.arange(0.0, max(first.values()), STEP)
        demand = self.needs.along(scenario.trajectory(start), times, np.zeros(len(times)))
        p = self.limits
        stands = replace(p, reference_tilt=min(p.reference_tilt, p.start_tilt))
        found = replace(self, limits=stands).exceeded(demand)
        return [one for one in found if one.quantity != DRAGGED]

    def exceeded(self, demand: Demand, ground: float | None = None) -> list[Excess]:
        """Return every limit that a demand exceeds, the earliest first.

        ground [m]: height of the origin at the take-off, None for that of the demand's begin.
        """
        p = self.limits
        ground = demand.position[0, Z] if ground is None else ground
        low, high = self.limits.room(ground)
        place, upper = demand.position.T, [*self._motion(demand), *self._loads(demand)]
        lowest, highest = p.joint_ranges
        angles = [(f"joint {i + 1} angle", one) for i, one in enumerate(demand.angles.T)]
        chain, ends = self.needs.arm
        if chain is not None:
            lowest, highest = np.column_stack([p.joint_ranges, ends])
            hinge = hinge_angles(chain, np.ascontiguousarray(demand.angles))
            angles.append(("angle of the hand's hinge", hinge))
        upper += [(*angle, highest[i], "rad") for i, angle in enumerate(angles)]
        upper += [("xyz"[i], place[i], high[i], "m") for i in range(3)]
        lower = [("xyz"[i], place[i], low[i], "m") for i in range(3)]
        lower += [(*angle, lowest[i], "rad") for i, angle in enumerate(angles)]
        height, sinking = self._near_ground(demand, ground)
        lower.append((DRAGGED, height, p.touchdown_height, "m"))
        upper.append(("sink rate near the ground", sinking, HARD, "m/s"))
        found = []
        for sign, checks in ((1.0, upper), (-1.0, lower)):
            for quantity, values, limit, unit in checks:
                beyond = sign * values > sign * limit + ROUNDING
                if beyond.any():
                    worst, first = int(np.nanargmax(sign * values)), int(np.argmax(beyond))
                    at = float(demand.times[worst]), float(demand.times[first])
                    origin = self._origin if quantity == THRUST else ""
                    excess = Excess(quantity, float(values[worst]), float(limit), unit, *at, origin)
                    found.append(excess)
        return sorted(found, key=lambda excess: excess.first)

    def _motion(self, demand: Demand) -> list[tuple[str, np.ndarray, float, str]]:
        """Return quantity, values (m,), limit and unit of the base's motion."""
        p = self.limits
        rates = np.abs(demand.body_rates[:, : YAW - ROLL]).max(axis=1)
        return [
            (THRUST, demand.thrust, self.thrust_limit, "N"),
            ("tilt", demand.tilt, min(p.reference_tilt, p.tilt_hold), "rad"),
            ("body rate", rates, min(p.reference_body_rate, p.body_rate_hold), "rad/s"),
            ("change of the body rate", demand.turn, p.largest_turn, "rad/s^2"),
            ("yaw rate", np.abs(demand.body_rates[:, YAW - ROLL]), p.reference_yaw_rate, "rad/s"),
        ]

    def _loads(self, demand: Demand) -> list[tuple[str, np.ndarray, float, str]]:
        """Return the same of the torques of rotors and joints, and of the magnet."""
        p = self.limits
        found = [("yaw torque", np.abs(demand.yaw_torque), p.reference_yaw_torque, "N m")]
        for i in range(demand.angles.shape[1]):
            rate, torque = (
                np.abs(values[:, i]) for values in (demand.joint_rates, demand.joint_torques)
            )
            found += [
                (f"joint {i + 1} rate", rate, self.vehicle.servos[i].no_load_speed, "rad/s"),
                (f"joint {i + 1} torque", torque, p.joint_effort_hold[i], "N m"),
            ]
        if (gripper := self.vehicle.gripper).kind != NO_GRIPPER:
            found.append(
                (f"force on the {gripper.name}", demand.magnet_force, gripper.holding, "N")
            )
        return found

    def _near_ground(self, demand: Demand, ground: float) -> tuple[np.ndarray, np.ndarray]:
        """Return heights (m,) [m] of a vehicle that moves across, and sink rates (m,) [m/s] of one
        that comes straight down; infinite at all other times."""
        height = demand.position[:, Z] - ground
        velocity = np.gradient(demand.position, demand.times, axis=0)
        across = np.hypot(velocity[:, X], velocity[:, Y]) > CRAWL
        airborne = height > self.limits.airborne_height
        lands = ~across & ~airborne
        return np.where(across, height, np.inf), np.where(lands, -velocity[:, Z], -np.inf)

    @cached_property
    def needs(self) -> Needs:
        """What references need of the vehicle."""
        return Needs(self.vehicle)

    @property
    def thrust_limit(self) -> float:
        """Largest force [N] of a reference: `reference_thrust`, if the vehicle has that much; less
        the reserve."""
        limits, vehicle = self.limits, self.vehicle
        most = USABLE * vehicle.full_thrust if self._origin else limits.reference_thrust
        weight = (vehicle.mass + self.payload_mass) * vehicle.gravity
        return most - self.reserve * max(0.0, most - weight)

    @property
    def _origin(self) -> str:
        """Return where the limit of the thrust is from, in words; "": from the parameter."""
        if self.limits.reference_thrust <= LARGEST * self.vehicle.full_thrust:
            return ""
        return f"{USABLE:.0%} of the full thrust".replace("%", " %")

    def check(self, scenario: Scenario) -> str:
        """Return a note about a thrust that leaves less than `retime_reserve`, "" for nothing.

        Raises InfeasibleReference if the scenario exceeds a limit.
        """
        near = replace(self, reserve=self.limits.retime_reserve).excesses(scenario)
        if not near:
            return ""
        if found := self.excesses(scenario):
            raise InfeasibleReference(f"scenario {scenario.name}: {in_words(found)}")
        most = max(excess.value for excess in near)
        return (
            f"the reference needs {most:.3g} of {self.thrust_limit:.3g} N, and wind, a weak "
            "battery or uneven rotors need thrust, too; --retime leaves some"
        )

    def fitted(self, scenario: Scenario) -> Scenario:
        """Return the scenario with other ramps in place of those that exceed a limit, if there are
        some that do not."""
        route = scenario.route
        if route is None or not route.ramps_chosen:
            return scenario
        phases = {excess.ramp for excess in self.excesses(scenario)}
        return scenario.along(route.with_ramps(phases, self._ramp)) if any(phases) else scenario

    def _ramp(self, goal: np.ndarray) -> Polynomials | None:
        """Return the shortest run-up to goal (5, 6 + n) that leaves a reserve, else the one that
        needs least, None if each exceeds a limit."""
        room = self.limits.room(STANDING)
        room[0, Z] = max(room[0, Z], STANDING + self.limits.touchdown_height)
        room += np.array([[CLEAR], [-CLEAR]])
        begin = goal[CHI, POSITION]
        best, least = None, math.inf
        for ramp in within_room(goal, np.minimum(room[0], begin), np.maximum(room[1], begin)):
            times = np.arange(0.0, ramp.length, STEP)
            demand = self.needs.along(ramp, times, np.zeros(len(times)))
            used = max((values / limit).max() for _, values, limit, _ in self._motion(demand))
            if used < least and not self.exceeded(demand, STANDING):
                best, least = ramp, used
                if used <= USED:
                    break
        return best

    def retimed(self, scenario: Scenario) -> tuple[Scenario, float]:
        """Return the scenario slowed down until it is feasible, and the factor, 1 if it is already.

        `retime_reserve` stays free: what is retimed shall fly in wind, too, with a weak battery and
        uneven rotors. A weak vehicle, whose take-off already needs some of it, has none. Ramps that
        are not part of the trajectory are fitted first, and at each slowdown. Raises
        InfeasibleReference if no slowdown up to SLOWEST makes it feasible.
        """
        try:
            return _slowed(replace(self, reserve=self.limits.retime_reserve), scenario)
        except InfeasibleReference:
            return _slowed(self, scenario)

    def carried(self, scenario: Scenario, times: np.ndarray) -> np.ndarray:
        """Return the carried mass (m,) [kg] at times (m,) [s]."""
        on = np.zeros(len(times))
        for at, energised in scenario.magnet:
            on[times >= at] = energised
        return self.payload_mass * on


def _slowed(check: Feasibility, scenario: Scenario) -> tuple[Scenario, float]:
    """Return the scenario slowed down until it meets the check, and the factor; see `retimed`."""
    scenario = check.fitted(scenario)
    found = check.excesses(scenario)
    if not found:
        return scenario, 1.0
    chosen = scenario.route is not None and scenario.route.ramps_chosen
    low, high = 1.0, 1.1
    while found:
        places = [
            excess
            for excess in found
            if (excess.unit == "m" and not (chosen and excess.ramp)) or "angle" in excess.quantity
        ]
        if places or low >= SLOWEST:
            text = f"{in_words(places or found)}, and a slowdown does not help"
            raise InfeasibleReference(f"scenario {scenario.name}: {text}")
        slower = check.fitted(scenario.slowed(high))
        found = check.excesses(slower)
        if found:
            low, high = high, min(high * high, SLOWEST)
    while high / low > 1.0 + PRECISION:
        middle = math.sqrt(low * high)
        if check.excesses(check.fitted(scenario.slowed(middle))):
            low = middle
        else:
            high = middle
    factor = min(high * ROOM, SLOWEST)
    return check.fitted(scenario.slowed(factor)), factor


def in_words(excesses: list[Excess]) -> str:
    """Return the excesses in one line."""
    return "; ".join(excess.text for excess in excesses)
