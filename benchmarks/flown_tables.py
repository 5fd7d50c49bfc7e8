"""Fly the rows of a table of the documentation; print it as the page has it.

    .venv/bin/python benchmarks/flown_tables.py vehicles     # docs/your_vehicle.md
    .venv/bin/python benchmarks/flown_tables.py --list       # all tables

flown_tables.yaml has the flights: per row the options of `uam_lab.Flight`, over those of `all`.
`row` (a line, or several) takes the row's label and the values below:

- position [mm], attitude [deg], arm [deg]: RMS per axis from take-off command to touchdown command;
- path: 3-D RMSE of the phase `trajectory` [mm]; payload: from its place [cm];
- factor: of the thrust identification at the end;
- reaction, after [s]: first unplanned state after the fault; tilt: largest from then on [deg];
- s: stability.json.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from uam_lab.flights.library.flight import Flight
from uam_lab.flights.library.flight_result import FlightResult
from uam_lab.report.build import stability_of

TABLES = Path(__file__).with_suffix(".yaml")
NONE = float("nan")


class Numbers(tuple[float, ...]):
    """Numbers that take one format: f"{Numbers((1, 2)):.1f}" is "1.0, 2.0"."""

    __slots__ = ()

    def __format__(self, spec: str) -> str:
        return ", ".join(format(number, spec) for number in self)


def figures(result: FlightResult) -> dict[str, Any]:
    """Return the values for a row, see above."""
    metrics, series = result.metrics, result.series
    rms, path = metrics["rms"], metrics["trajectory"]
    found = {
        "position": Numbers(1e3 * value for value in rms["position_m"]),
        "attitude": Numbers(rms["attitude_deg"]),
        "arm": Numbers(rms["arm_deg"]),
        "path": 1e3 * path["position_3d_m"] if path else NONE,
        "payload": 1e2 * (metrics["payload_place_error_m"] or NONE),
        "factor": metrics["thrust_factor"]["end"] if metrics["thrust_factor"] else NONE,
    }
    if metrics["faults"]:
        began = metrics["faults"][0]["begin_s"]
        later = (t for t in metrics["transitions"] if t["time_s"] > began)
        first = next((t for t in later if t["cause"] != "as planned"), None)
        found |= {
            "reaction": first["to"] if first else "none",
            "after": first["time_s"] - began if first else NONE,
            "tilt": np.degrees(series.tilt[series.time >= began].max()),
        }
    return found


def printable(tree: Any) -> Any:
    """Return nested dictionaries with every array as Numbers."""
    if isinstance(tree, Mapping):
        return {name: printable(value) for name, value in tree.items()}
    return Numbers(tree) if isinstance(tree, np.ndarray) else tree


def rows(table: Mapping[str, Any]) -> Iterator[str]:
    """Fly the rows of a table; yield their lines as they are done."""
    for label, own in table["rows"].items():
        options = {**table.get("all", {}), **(own or {})}
        with tempfile.TemporaryDirectory() as folder:
            with Flight(**options, out=Path(folder) / "flight") as flight:
                result = flight.wait()
            found = figures(result)
            if "{s[" in table["row"]:
                found["s"] = printable(stability_of(result.folder, result.series).summary())
        yield table["row"].format(label=label, **found).replace("nan", "").rstrip("\n")


def main() -> None:
    """Print tables as markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    tables = yaml.safe_load(TABLES.read_text())
    parser.add_argument("tables", nargs="*", metavar="TABLE", choices=[*tables, []])
    parser.add_argument("--list", action="store_true", help="list the tables")
    options = parser.parse_args()
    if options.list or not options.tables:
        print("\n".join(tables))
    for name in options.tables:
        columns = tables[name]["head"]
        print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
        for line in rows(tables[name]):
            print(line, flush=True)


if __name__ == "__main__":
    main()
