"""What a law of the duel leaves with another feed, later setpoints or another standing force.

    .venv/bin/python benchmarks/duel_feed.py                       # whole-body L1, two tasks
    .venv/bin/python benchmarks/duel_feed.py --changes none feed_late --tasks all --seeds 3
    .venv/bin/python benchmarks/duel_feed.py --row MAC --changes feed_late

A feed is what the law reads in place of the estimate: true values, held from sample to sample, with
noise. Flies one flight after the other in the direct engine. Prints end effector and platform, RMSE
[mm], mean of the completed flights, below the published figures.
"""

from __future__ import annotations

import argparse
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DOT, ROLL
from uam_control.stages.control_tick import ControlTick
from uam_lab.experiments.duel import flights
from uam_lab.experiments.duel.flights import mean
from uam_lab.experiments.trials.trial import Trial
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results.templates import markdown_table
from uam_lab.records.results.terminal import say
from uam_sim_bridge.plant.effects import presets

PLANT, LOAD = "t650_mirror", "standing_load"
LAWS = "whole body", "position law"  # the stage of the first law: one of them
READS_AGAIN = "bridge"  # the stage after the laws, which is given the estimate


@dataclass(frozen=True)
class Feed:
    """rate [Hz]; noise [m, m/s] of position and velocity; latency [s]; turned: attitude, too."""

    rate: float
    noise: tuple[float, float] = (0.0, 0.0)
    latency: float = 0.0
    turned: bool = False

    def insert(self, flight: DirectFlight) -> None:
        """Let the laws of a flight read this feed."""
        samples = deque(maxlen=round(self.latency / flight.plant.period) + 1)
        random, columns = np.random.default_rng(1), ALPHA if self.turned else ROLL
        held = estimate = np.zeros(0)
        due = 0.0

        def give(tick: ControlTick) -> bool:
            nonlocal held, estimate, due
            samples.append(flight.plant.truth().state.copy())
            if flight.plant.time >= due - 1e-9:
                due, held = flight.plant.time + 1.0 / self.rate, samples[0].copy()
                for row, size in zip((CHI, CHI_DOT), self.noise, strict=True):
                    held[row, :ROLL] += size * random.standard_normal(ROLL)
            state, estimate = tick.signals.state, tick.signals.state.copy()
            state[CHI, :columns], state[CHI_DOT, :ROLL] = held[CHI, :columns], held[CHI_DOT, :ROLL]
            return True

        def take_back(tick: ControlTick) -> bool:
            tick.signals.state[:] = estimate
            return True

        names = [stage.name for stage in flight.control.stages]
        law = next(name for name in LAWS if name in names)
        flight.control.insert(law, "feed", give, decides=False)
        flight.control.insert(READS_AGAIN, "estimate again", take_back, decides=False)


@dataclass(frozen=True)
class Change:
    """What differs from the duel: feed; delay [ms] of the setpoints; of the standing load: force,
    times the plant's, and switches, see `presets.read`."""

    about: str
    feed: Feed | None = None
    delay: float = 0.0
    force: float = 1.0
    switches: tuple[str, ...] = ()

    def fly(self, trial: Trial) -> flights.DuelResult:
        """Fly a trial with it. Raises TrialFailed."""
        load = presets.read((PLANT,))[LOAD]["force"]
        force = "/".join(f"{self.force * one:g}" for one in load)
        effects = presets.read((PLANT,), (f"{LOAD}:force={force}", *self.switches))
        trial = replace(trial, vehicle_changes=presets.added({}, effects))
        trial = flights.delayed(trial, self.delay) if self.delay else trial
        return flights.measure(trial, self.feed.insert if self.feed else None)


HELD = Feed(60.0, (0.0005, 0.022))  # [s2r]: 60 Hz, white noise of 0.5 mm and 0.022 m/s
CHANGES = {
    "none": Change("none"),
    "true": Change("true position and velocity in place of the estimate", Feed(1e4)),
    "feed": Change("those of a 60 Hz feed, held, 0.5 mm and 0.022 m/s of noise", HELD),
    "late": Change("setpoints 8 ms later", delay=8.0),
    "feed_late": Change(
        "that feed, the attitude too, 4 ms late, and setpoints 8 ms later",
        replace(HELD, latency=0.004, turned=True),
        delay=8.0,
    ),
    "force_1.5": Change("1.5 times the standing force", force=1.5),
    "force_2": Change("twice the standing force", force=2.0),
    "world": Change("the standing force in the world's axes", switches=(f"{LOAD}:turning=0",)),
    "no_force": Change("no standing force, nor torque", switches=(f"{LOAD}=off",)),
}


def table(row: str, changes: list[str], tasks: list[str], seeds: int) -> str:
    """Fly a row of the duel with changes in tasks; return the table."""
    duel = flights.load_duel("fsc_lab", (row,))
    tasks = [task for task in duel.scenarios if "all" in tasks or task in tasks]
    published = duel.published.get(row, {})
    said = [_cell(*published[task][:2]) if task in published else "-" for task in tasks]
    lines = [["published", *said, "", ""]]
    planned = [one for one in flights.trials(duel, seeds) if not one.drawn["delay"]]
    for change in (CHANGES[name] for name in changes):
        found = []
        for trial in planned:
            if trial.scenario in (*tasks, duel.hover):
                found.append(change.fly(trial))
                say(f"{change.about}; {trial.scenario}, seed {trial.seed}: {found[-1].outcome}")
        of = [[one for one in found if one.scenario == task] for task in tasks]
        cells = [_cell(_mean(task, "hand"), _mean(task, "platform")) for task in of]
        standing, lost = _mean(found, "standing"), sum(one.lost for one in found)
        lines.append([change.about, *cells, f"{standing:.1f}", f"{lost} of {len(found)}"])
    return markdown_table([row, *tasks, "standing offset [mm]", "lost"], lines)


def _mean(results: list[flights.DuelResult], figure: str) -> float:
    return flights.MILLI * mean(getattr(one, figure) for one in results)


def _cell(hand: float, platform: float) -> str:
    return f"{hand:.1f} ({platform:.1f})"


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option("--row", default="whole-body L1", help="row of config/duel/fsc_lab.yaml")
    option(
        "--changes",
        nargs="+",
        default=list(CHANGES),
        choices=CHANGES,
        metavar="NAME",
        help=", ".join(CHANGES),
    )
    option(
        "--tasks",
        nargs="+",
        default=["ee_circle_013", "ee_figure8_020"],
        metavar="NAME",
        help="or all",
    )
    option("--seeds", type=int, default=1, help="1 to this (default %(default)s)")
    options = parser.parse_args()
    say(table(options.row, options.changes, options.tasks, options.seeds))


if __name__ == "__main__":
    main()
