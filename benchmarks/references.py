"""Fly the references of the library; print the table of docs/scenarios.md.

    python benchmarks/references.py                           # direct engine, seed 1
    python benchmarks/references.py --seeds 1 2 --engine ros lemniscate race_5
    python benchmarks/references.py --vehicle my/s500.yaml    # with its own profile

Per reference: 3-D RMSE and largest distance of the position in the phase `trajectory`, largest tilt
and thrust there, and the end of the flight. A reference that the vehicle cannot fly is slowed down
(--retime), and the table says by how much.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from uam_control.mission import ScenarioError
from uam_control.vehicle import DEFAULT_VEHICLE, load_description
from uam_lab.flights.library.flight import Flight
from uam_lab.flights.library.flight_result import FlightError

REFERENCES = (
    *("circle", "circle_fast", "circle_payload", "lemniscate", "lemniscate_payload", "arm_sweep"),
    *("ellipse_yaw", "waypoints", "race_5", "race_5_payload", "race_10", "race_10_payload"),
    "ellipse",
)
OPENED = "race_10"  # references whose name begins so need the limits of this profile
HEADINGS = ("reference", "3-D RMSE [mm]", "largest [mm]", "tilt [°]", "thrust [N]", "end")


def row(name: str, seed: int, options: argparse.Namespace) -> tuple[str, ...]:
    """Fly one reference; return its row."""
    profiles = options.profile or [load_description(options.vehicle).profile("modular")]
    profiles = [*profiles, OPENED] if name.startswith(OPENED) else profiles
    with tempfile.TemporaryDirectory() as folder:
        given = {"engine": options.engine, "vehicle": options.vehicle, "profile": profiles}
        given |= {"scenario": name, "seed": seed, "out": Path(folder) / "flight"}
        try:
            flight = Flight(**given)
        except ScenarioError:
            try:
                flight = Flight(**given, retime=True)
            except ScenarioError as error:
                return (name, "", "", "", "", f"refused: {error}")
        slower = flight.settings.scenario_options.slowdown
        try:
            with flight:
                metrics = flight.wait().metrics
        except FlightError as error:
            return (name, "", "", "", "", str(error))
    label = f"{name}, {slower:.2f} × as slow" if slower > 1.0 else name
    found = metrics["trajectory"]
    end = "completed" if metrics["mission_completed"] else "; ".join(metrics["shortfalls"])
    if found is None:
        return (label, "", "", "", "", end)
    return (
        label,
        f"{1e3 * found['position_3d_m']:.1f}",
        f"{1e3 * found['largest_3d_m']:.1f}",
        f"{found['tilt_deg']:.1f}",
        f"{found['thrust_n']:.1f}",
        end,
    )


def main() -> None:
    """Print the table as markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("references", nargs="*", default=REFERENCES)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--engine", choices=("direct", "ros"), default="direct")
    parser.add_argument("--vehicle", default=DEFAULT_VEHICLE)
    parser.add_argument("--profile", nargs="+", help="default: the vehicle's")
    options = parser.parse_args()
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    for name in options.references:
        for seed in options.seeds:
            shown = row(name, seed, options)
            print(f"| {' | '.join(shown)} |", flush=True)


if __name__ == "__main__":
    main()
