"""Body-rate steps of the stand-in beside those of PX4, in hover.

Both fly the same experiment (`rate_experiment`) with the same parameters. Left in --out: steps.csv,
steps.json, steps.png.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import numpy as np
from px4_steps.hover_flight import HoverFlight, NotFlown
from px4_steps.rate_experiment import AXES, experiment, responses
from px4_steps.step_response import distance, figures

from uam_control.settings.atomic import replacing, write_rows, write_text
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.flights.processes.node_environment import environment
from uam_lab.flights.processes.processes import NodeFailed, Processes
from uam_lab.records.results.result_folder import ResultFolderError, as_json, make_folder
from uam_lab.report.figures import style
from uam_sim_bridge.ports import PortError, Reservation
from uam_sim_bridge.px4.px4_installation import VARIABLE, Px4Error, Px4Installation, required

STAND_IN, PX4 = "stand-in", "PX4"
STAND_IN_MODULE, SITL_MODULE = "uam_sim_bridge.autopilot.server", "uam_sim_bridge.px4.sitl"
LIMIT = 0.10  # of the step: how far the curves may be apart
PATIENCE = 60.0  # [s] for an autopilot to connect

Responses = dict[str, tuple[np.ndarray, np.ndarray]]


@contextmanager
def flown_by(px4: Px4Installation | None) -> Iterator[HoverFlight]:
    """A hover flight to which PX4, or the stand-in for None, is connected.

    Raises NotFlown, PortError.
    """
    with (
        tempfile.TemporaryDirectory(prefix="uam-hover-") as folder,
        Reservation() as reservation,
        Processes(Path(folder), environment(reservation.ports.domain, Path(folder))) as children,
    ):
        ports = reservation.ports
        flight = HoverFlight(ports, always_answers=px4 is None)
        try:
            module, arguments = STAND_IN_MODULE, ["--instance", str(ports.instance)]
            if px4 is not None:
                module = SITL_MODULE
                arguments += ["--px4-dir", str(px4.directory)]
            children.start("autopilot", module, arguments, True)
            flight.connect(PATIENCE)
            yield flight
        finally:
            flight.close()
            children.stop(["autopilot"])


def measure(px4: Px4Installation | None) -> Responses:
    """Fly the experiment with PX4, or with the stand-in for None. Raises NotFlown, PortError."""
    with flown_by(px4) as flight:
        return responses(flight, experiment())


def compared(stand_in: Responses, px4: Responses) -> dict[str, dict]:
    """Per axis: the figures of both, and the distance of the two curves."""
    return {
        axis: {
            STAND_IN: asdict(figures(*stand_in[axis])),
            PX4: asdict(figures(*px4[axis])),
            "distance": distance(stand_in[axis][1], px4[axis][1]),
        }
        for axis in AXES
    }


def write(out: Path, stand_in: Responses, px4: Responses, found: dict[str, dict]) -> None:
    """Write table, figures and picture to `out`."""
    write_text(out / "steps.json", as_json({"limit": LIMIT, "axes": found}))
    rows = [
        [axis, f"{t:.3f}", f"{ours:.5f}", f"{theirs:.5f}"]
        for axis in AXES
        for t, ours, theirs in zip(*stand_in[axis], px4[axis][1], strict=True)
    ]
    write_rows(out / "steps.csv", ["axis", "time_s", STAND_IN, PX4], rows)
    import matplotlib.pyplot as plt

    with style.styled():
        figure, axes = plt.subplots(
            1, len(AXES), figsize=(style.WIDTH, 2.9), sharey=True, layout="constrained"
        )
        for place, axis in zip(axes, AXES, strict=True):
            time = 1000.0 * stand_in[axis][0]
            place.step(time, time >= 0.0, where="post", color=style.REFERENCE, label="setpoint")
            place.plot(time, stand_in[axis][1], color=style.FLIGHTS[0], label=STAND_IN)
            place.plot(time, px4[axis][1], color=style.FLIGHTS[1], label=PX4)
            place.set_title(
                f"{axis}: {100.0 * found[axis]['distance']:.1f} % apart (RMS)", loc="left"
            )
            place.set_xlabel("time from the step [ms]")
        axes[0].set_ylabel("body rate / step")
        axes[0].legend(loc="lower right")
        with replacing(out / "steps.png") as temporary:
            figure.savefig(temporary, format="png", dpi=style.PIXELS_PER_INCH)
        plt.close(figure)


def main() -> int:
    """Compare: 0 all axes within LIMIT, 1 not; 2 where nothing could be flown."""
    parser = argparse.ArgumentParser(
        prog="benchmarks/rate_steps.py",
        description=__doc__.splitlines()[0],
        epilog="example: .venv/bin/python benchmarks/rate_steps.py --px4-dir "
        "~/PX4-Autopilot/build/px4_sitl_default --out results/rate-steps",
    )
    parser.add_argument("--px4-dir", metavar="DIR", help=required(VARIABLE))
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="result folder (default results/<time>-rate-steps)"
    )
    options = parser.parse_args()
    try:
        px4 = Px4Installation.find(options.px4_dir)
        out = make_folder(options.out, "rate-steps")
        prepare(print)
        responses = []
        for name, autopilot in ((STAND_IN, None), (PX4, px4)):
            print(f"flying the steps with {name}", flush=True)
            responses.append(measure(autopilot))
        found = compared(*responses)
        write(out, *responses, found)
    except (Px4Error, PortError, ResultFolderError, NotFlown, NodeFailed) as error:
        print(f"rate_steps: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    print("axis    apart   time constant [ms]   overshoot     final")
    for axis, row in found.items():
        ours, theirs = row[STAND_IN], row[PX4]
        print(
            f"{axis:<6} {100.0 * row['distance']:5.1f} %   "
            f"{1000.0 * ours['time_constant']:6.1f} / {1000.0 * theirs['time_constant']:6.1f}"
            f"     {ours['overshoot']:.2f} / {theirs['overshoot']:.2f}"
            f"   {ours['final']:.2f} / {theirs['final']:.2f}   ({STAND_IN} / {PX4})"
        )
    print(f"results {out}")
    return 0 if all(row["distance"] <= LIMIT for row in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
