"""`python -m uam_lab.analysis FOLDER`: analyse a recorded flight and print the result as JSON."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from uam_control.profiles.profile import ProfileError
from uam_lab.analysis.folder import analyse_folder
from uam_lab.results import timeseries
from uam_lab.results.result_folder import as_json


def main() -> int:
    """Print stability.json of the flight in a result folder; 2 if it cannot be analysed."""
    parser = argparse.ArgumentParser(prog="python -m uam_lab.analysis", description=__doc__)
    parser.add_argument("folder", type=Path, help="result folder of a flight of the modular law")
    folder = parser.parse_args().folder
    try:
        found = analyse_folder(folder, timeseries.read(folder / "timeseries.parquet"))
    except (timeseries.UnreadableFlight, ProfileError) as error:
        print(error, file=sys.stderr)
        return 2
    if found is None:
        print(f"{folder}: no airborne flight of the modular law in this folder", file=sys.stderr)
        return 2
    print(as_json(found.summary()), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
