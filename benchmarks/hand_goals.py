"""Send random goals to the hand in the direct engine: reached, or refused with the right reason?

    python benchmarks/hand_goals.py               # 200 goals inside, 30 outside, three vehicles
    python benchmarks/hand_goals.py --goals 10 --vehicle t650
    python benchmarks/hand_goals.py --jog         # whether the hand rests after the last twist
    python benchmarks/hand_goals.py --jog --plant-preset laboratory

A goal inside is the pose of the tool of a random base and random joints within their ranges, up to
REACH from the place before; every second one is a place and a heading alone. It counts as reached
with the true hand within 5 mm and 1 deg, in the mean of WINDOW, SETTLE after its plan has ended: a
vehicle in the air wanders by some millimetres. A goal outside is below
the floor, beyond the room of the base and the reach of the arm, or has no finite place. The
hand of a vehicle whose hand hangs is where its hinge has it. Seed 1.

A jog is asked for at 0.3 m/s or 0.3 rad/s, so it is flown at its limits. The speed of the hand is
the mean of 0.1 s; that in hover, and later, is one that nine of ten means do not exceed.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from uam_control.arm.hand import HEADING, reach, tools
from uam_control.coordinates import ARM, CHI, POSITION, YAW, Z
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.hand_goals import HandPose, HandTwist, base_room, joint_room
from uam_control.mission.motion.flatness import Flyer
from uam_control.supervision import State
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.flight_settings import settings
from uam_sim_bridge.plant import Vehicle

VEHICLES = ("s500_arm", "s500_arm3", "t650")
GOALS = 200
REACH, SETTLE, WINDOW, LOOKS = 0.5, 1.5, 2.0, 20  # [m], [s], [s], in the window
NEAR, TURNED = 0.005, math.radians(1.0)
EVERY, JOGGED, QUIET = 0.05, 2.0, 2.0  # [s] from twist to twist, of them, after the last one
MEAN, STOPPED = 0.1, 0.3  # [s] of a speed, after the last twist
ASKED = 0.3  # [m/s, rad/s]


class Hovering:
    """A flight in the direct engine that hovers and takes goals."""

    def __init__(self, name: str, presets: Sequence[str] = ()) -> None:
        s = settings("hover", vehicle=name, engine="direct", seed=1, plant_preset=presets)
        self.vehicle, self.flyer = s.vehicle, Flyer.of(s.vehicle)
        vehicle = Vehicle.of(s.vehicle).changed(s.vehicle_changes)
        self._flight = DirectFlight(s.scenario, s.profile, vehicle, s.payload_mass, s.seed)
        self.limits = s.profile.sets["mission"]
        self.period = self._flight.plant.period
        self.ground = math.nan
        self.run(7.0)
        self.ask(HandPose(self.flyer, np.array([*self.reference[POSITION], *[math.nan] * 3])))

    def run(self, seconds: float) -> None:
        """Fly on."""
        for _ in range(round(seconds / self.period)):
            self._flight.tick()
            if math.isnan(self.ground) and self._flight.mission.output.flying:
                self.ground = float(self.reference_of_base[Z])

    def ask(self, goal: HandPose | HandTwist) -> tuple[bool, str]:
        """Send a goal; return whether it is accepted, and the answer."""
        return self._flight.mission.plan(goal)

    def arrive(self) -> None:
        """Fly to the end of the plan, and SETTLE longer."""
        output = self._flight.mission.output
        self.run(self.period * 2)
        while output.state is State.FLYING:
            self.run(0.1)
        assert output.state is State.HOLDING, output
        self.run(SETTLE)

    def off(self, wanted: np.ndarray) -> np.ndarray:
        """Return TOOL (6,) of the hand minus `wanted`, mean of the next WINDOW; 0 for NaN."""
        found = []
        for _ in range(LOOKS):
            self.run(WINDOW / LOOKS)
            found.append(self.hand - wanted)
            found[-1][HEADING:] = np.nan_to_num(wrap_angle(found[-1][HEADING:]))
        return np.mean(found, axis=0)

    @property
    def reference_of_base(self) -> np.ndarray:
        """chi (6 + n,) of the reference."""
        return self._flight.mission.output.reference[CHI]

    @property
    def reference(self) -> np.ndarray:
        """TOOL (6,) of the reference."""
        return tools(self.flyer.chain, self.reference_of_base[None])[0]

    @property
    def hand(self) -> np.ndarray:
        """TOOL (6,), true."""
        return self.hands(1)[0]

    def hands(self, rows: int) -> np.ndarray:
        """TOOL (rows, 6) of the newest ticks, true."""
        recording = self._flight.recording
        row = recording.values[recording.count - rows : recording.count]
        chi = row[:, recording.columns.block("truth.")][:, : len(self.reference_of_base)]
        swing = row[:, recording.columns["magnet.swing"]]
        return tools(self.flyer.chain, *map(np.ascontiguousarray, (chi, swing)))

    def speeds(self, seconds: float) -> np.ndarray:
        """Speed [mm/s] and turn rate of the heading [deg/s] (2, m) in the newest `seconds`."""
        step = round(MEAN / self.period)
        hands = self.hands(round(seconds / self.period))
        moved = (hands[step:] - hands[:-step]) / MEAN
        moved[:, HEADING] = wrap_angle(moved[:, HEADING] * MEAN) / MEAN
        turn = np.degrees(np.abs(moved[:, HEADING]))
        return np.stack([1e3 * np.linalg.norm(moved[:, POSITION], axis=1), turn])


def inside(flight: Hovering, rng: np.random.Generator, heading_only: bool) -> np.ndarray:
    """Return TOOL (6,) of a pose that the vehicle can have."""
    low, high = joint_room(flight.limits)
    corners = base_room(flight.limits, flight.ground)
    chi = flight.reference_of_base.copy()
    chi[POSITION] = np.clip(chi[POSITION] + rng.uniform(-REACH, REACH, 3), *corners)
    chi[YAW], chi[ARM] = rng.uniform(-math.pi, math.pi), rng.uniform(low, high)
    wanted = tools(flight.flyer.chain, chi[None])[0]
    if heading_only:
        wanted[HEADING + 1 :] = math.nan
    return wanted


def outside(flight: Hovering, rng: np.random.Generator) -> tuple[np.ndarray, str]:
    """Return a pose that no vehicle can have, and the reason."""
    wanted = inside(flight, rng, True)
    kind, far = rng.integers(4), reach(flight.flyer.chain) + rng.uniform(0.5, 3.0)
    corners = base_room(flight.limits, flight.ground)
    if kind == 0:
        wanted[Z] = flight.limits.hand_floor - rng.uniform(0.01, 2.0)
    elif kind == 1:
        axis, side = rng.integers(3), rng.integers(2)
        wanted[axis] = corners[side, axis] + (far if side else -far)
    elif kind == 2:
        wanted[rng.integers(3)] = rng.choice([math.nan, math.inf])
        return wanted, "not finite"
    else:
        wanted[4:] = 0.0, rng.choice([-1.0, 1.0]) * rng.uniform(1.42, 1.55)
        return wanted, "singular"
    return wanted, "out of reach"


def goals(name: str, presets: Sequence[str], count: int) -> None:
    """Print how the goals of a vehicle end."""
    flight, rng, ends = Hovering(name, presets), np.random.default_rng(1), Counter()
    distances, turns = [], []
    for number in range(count):
        wanted = inside(flight, rng, number % 2 == 0)
        accepted, text = flight.ask(HandPose(flight.flyer, wanted))
        if not accepted:
            ends[text.partition(":")[2].strip().partition(":")[0]] += 1
            print(f"  {name} {number}: {text}", flush=True)
            continue
        flight.arrive()
        off = flight.off(wanted)
        distances.append(float(np.linalg.norm(off[POSITION])))
        turns.append(float(np.abs(off[HEADING:]).max()))
        met = distances[-1] <= NEAR and turns[-1] <= TURNED
        ends["reached" if met else "missed"] += 1
        if not met:
            print(
                f"  {name} {number}: {1e3 * distances[-1]:.1f} mm {np.degrees(off[HEADING:])} deg"
            )
    right = 0
    for _ in range(max(1, count * 30 // GOALS)):
        wanted, reason = outside(flight, rng)
        accepted, text = flight.ask(HandPose(flight.flyer, wanted))
        right += not accepted and reason in text
    outsiders = f"{right} of {max(1, count * 30 // GOALS)} outside refused with the right reason"
    worst = 1e3 * max(distances, default=0.0), math.degrees(max(turns, default=0.0))
    print(f"{name}: {dict(ends)}; worst {worst[0]:.1f} mm, {worst[1]:.2f} deg; {outsiders}")


def jog(name: str, presets: Sequence[str]) -> None:
    """Print how the true hand moves after the last of the twists, along and about each axis."""
    flight = Hovering(name, presets)
    flight.run(QUIET)
    hover = np.percentile(flight.speeds(QUIET), 90.0, axis=1)
    p = flight.limits
    print(
        f"{name}: {1e3 * p.jog_speed:.1f} mm/s, {math.degrees(p.jog_turn_rate):.1f} deg/s at most"
    )
    print(f"  in hover {hover[0]:.0f} mm/s, {hover[1]:.1f} deg/s")
    for axis, twist in zip(("x", "y", "z", "about z"), np.eye(6)[[0, 1, 2, 5]], strict=True):
        for _ in range(round(JOGGED / EVERY)):
            flight.ask(HandTwist(flight.flyer, *(ASKED * twist).reshape(2, 3)))
            flight.run(EVERY)
        flight.run(STOPPED - EVERY + MEAN)
        at_once = flight.speeds(MEAN + flight.period)[:, 0]
        flight.run(QUIET)
        later = np.percentile(flight.speeds(QUIET), 90.0, axis=1)
        print(f"  {axis}: 0.3 s later {at_once[0]:.0f} mm/s, {at_once[1]:.1f} deg/s; ", end="")
        print(f"then {later[0]:.0f} mm/s, {later[1]:.1f} deg/s", flush=True)


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicle", nargs="+", default=VEHICLES, help="names or files")
    parser.add_argument("--goals", type=int, default=GOALS, help=f"of each vehicle ({GOALS})")
    parser.add_argument("--plant-preset", nargs="*", default=(), help="as of uam fly")
    parser.add_argument("--jog", action="store_true", help="the stop of a jog in place of goals")
    options = parser.parse_args()
    for name in options.vehicle:
        if options.jog:
            jog(name, options.plant_preset)
        else:
            goals(name, options.plant_preset, options.goals)


if __name__ == "__main__":
    main()
