"""Results of a campaign so far, stored so that an interrupted campaign can continue."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from uam_control.settings.configuration import ConfigurationError
from uam_lab.campaign.trial import TrialResult
from uam_lab.results.atomic import write_text

FILE = "flown.jsonl"


class Flown:
    """The results in FILE of a result folder: the first line identifies the campaign, each other
    line is one flight. `results`: by the seed of the flight.
    """

    def __init__(self, out: Path, of: object) -> None:
        """of: all inputs of the flights; its repr identifies them.

        Raises ConfigurationError if the folder contains flights with other inputs.
        """
        self.results: dict[int, TrialResult] = {}
        self._file = out / FILE
        mark = {"of": hashlib.sha256(repr(of).encode()).hexdigest()}
        if not self._file.exists():
            self._file.write_text(json.dumps(mark) + "\n")
            return
        first, *lines = self._file.read_text().splitlines() or [""]
        if first != json.dumps(mark):
            raise ConfigurationError(
                f"{out} contains flights with another vehicle, scenario, profile, seed or range: "
                "give another --out"
            )
        for line in lines:
            try:
                result = _read(line)
            except (ValueError, TypeError):  # an incomplete last line after a kill
                continue
            self.results[result.seed] = result
        write_text(self._file, "\n".join([first, *map(_line, self.results.values()), ""]))

    def add(self, result: TrialResult) -> None:
        """Add one flight."""
        self.results[result.seed] = result
        with self._file.open("a") as file:
            file.write(_line(result) + "\n")


def _line(result: TrialResult) -> str:
    values = asdict(result) | {"rms": result.rms.tolist(), "largest": result.largest.tolist()}
    return json.dumps(values)


def _read(line: str) -> TrialResult:
    values = json.loads(line)
    for name in ("rms", "largest"):
        values[name] = np.array(values[name])
    return TrialResult(**values | {"restless": tuple(values["restless"])})
