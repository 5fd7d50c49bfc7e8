"""Settings of a flight as metadata of its log, so that the log alone describes the flight.

    flight       the entries of info.json that exist before the flight, each as JSON
    scenario     name and text of its file
    parameters   the effective parameters, a ROS parameter file
    versions     versions.json

The recorder writes them first, so that the log of a killed flight also contains them.
"""

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uam_control.mission import Scenario, ScenarioOptions, load_scenario
from uam_control.settings import configuration
from uam_control.vehicle import DEFAULT_VEHICLE, load_description
from uam_lab.records.recording.mcap_reader import UnreadableLog, read_metadata
from uam_lab.records.results.result_folder import write_json

FLIGHT, SCENARIO, TEXTS = "flight", "scenario", "files"
Records = dict[str, dict[str, str]]


@dataclass(frozen=True)
class LogFacts:
    """info: see `conclude.settings_facts`; texts: content of parameters.yaml, versions.json."""

    info: dict[str, Any] = field(default_factory=dict)
    scenario: Scenario | None = None
    texts: dict[str, str] = field(default_factory=dict)


def write(file: Path, info: Mapping[str, Any], scenario: str, texts: Mapping[str, str]) -> None:
    """Write the file with the metadata for the recorder; scenario: a name or a file."""
    source = configuration.named("scenarios", scenario)
    records: Records = {
        FLIGHT: {name: json.dumps(value) for name, value in info.items()},
        SCENARIO: {"name": source.name, "text": source.read_text(encoding="utf-8")},
        TEXTS: dict(texts),
    }
    write_json(file, records)


def read(log: Path) -> LogFacts:
    """Read the metadata of a log; missing parts are empty. Raises UnreadableLog, OSError."""
    records = read_metadata(log)
    try:
        info = {name: json.loads(text) for name, text in records.get(FLIGHT, {}).items()}
    except (ValueError, RecursionError) as error:
        raise UnreadableLog(f"{log}: the metadata '{FLIGHT}' is damaged: {error}") from None
    return LogFacts(info, _scenario(records.get(SCENARIO), info), records.get(TEXTS, {}))


def options_of(info: Mapping[str, Any]) -> ScenarioOptions:
    return ScenarioOptions.from_mapping(dict(info.get("scenario_options") or {}))


def _scenario(record: Mapping[str, str] | None, info: Mapping[str, Any]) -> Scenario | None:
    if not record:
        return None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / Path(record["name"]).name
        file.write_text(record["text"], encoding="utf-8")
        vehicle = load_description(info.get("vehicle") or DEFAULT_VEHICLE)
        return load_scenario(str(file), vehicle, options_of(info))
