"""What the devices of a rehearsal carried: rates and latencies, from /diagnostics in its log."""

import socket
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from statistics import median_low
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from uam_lab.records.recording.logged_topics import LABORATORY_FILE
from uam_lab.records.recording.mcap_reader import UnreadableLog, read_log
from uam_lab.records.results.result_folder import known_json
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.serialized import deserialized
from uam_msgs_py.messages.status import finite
from uam_sim_bridge.nodes.arm_driver import SLOWEST

NAME = "devices.json"
# node → name of the figure → key of /diagnostics; the median over the reports
MEDIANS: dict[str, dict[str, str]] = {
    "arm_driver": {
        "bus_rate_hz": "bus rate [Hz]",
        "bus_rate_possible_hz": "bus rate possible [Hz]",
        "bus_cycle_ms": "cycle, mean [ms]",
    },
    "mocap_driver": {
        "mocap_latency_ms": "latency median [ms]",
        "mocap_latency_p99_ms": "latency p99 [ms]",
        "mocap_rate_hz": "tick rate [Hz]",
    },
    "mavlink_bridge": {
        "round_trip_ms": "round trip [ms]",
        "setpoint_rate_hz": "tick rate [Hz]",
    },
}
LARGEST: dict[str, dict[str, str]] = {
    "arm_driver": {"bus_cycle_max_ms": "cycle, max [ms]"},
    "mocap_driver": {"mocap_frames_lost": "frames lost"},
}


def read(log: Path, logs: Path) -> dict[str, Any]:
    """Return the figures of the rehearsal in `log`; logs: folder of the statistics.

    Figures that the log does not have are missing.
    """
    try:
        found = read_log(log, lambda name: name == topics.DIAGNOSTICS.name)
    except (UnreadableLog, OSError):
        found = {}
    data = found[topics.DIAGNOSTICS.name].messages if found else []
    figures = of_reports(values_of(_reports(data)))
    return figures | of_laboratory(known_json(logs / LABORATORY_FILE))


def _reports(data: Iterable[bytes]) -> Iterator[DiagnosticArray]:
    """Yield the messages of /diagnostics; anyone may have sent bytes that are none."""
    for one in data:
        with suppress(BadMessage):
            yield deserialized(one, DiagnosticArray)


def values_of(messages: Iterable[DiagnosticArray]) -> dict[str, list[Mapping[str, str]]]:
    """Return the key-value pairs of each report, by node."""
    found: dict[str, list[Mapping[str, str]]] = {}
    for message in messages:
        for status in message.status:
            pairs = {pair.key: pair.value for pair in status.values}
            found.setdefault(status.name, []).append(pairs)
    return found


def of_reports(reports: Mapping[str, list[Mapping[str, str]]]) -> dict[str, float]:
    figures = {}
    for chosen, reduce in ((MEDIANS, median_low), (LARGEST, max)):
        for node, keys in chosen.items():
            for name, key in keys.items():
                numbers = [finite(pairs.get(key)) for pairs in reports.get(node, ())]
                numbers = [number for number in numbers if number is not None]
                if numbers:
                    figures[name] = round(reduce(numbers), 3)
    return figures


def of_laboratory(numbers: Mapping[str, Any]) -> dict[str, float]:
    wall = numbers.get("wall_s") or 0.0
    if not wall:
        return {}
    to, back = numbers["serial_bytes"]
    return {
        "serial_to_autopilot_kbyte_s": round(1e-3 * to / wall, 2),
        "serial_from_autopilot_kbyte_s": round(1e-3 * back / wall, 2),
        "plant_ticks_late": numbers["late_ticks"],
        "plant_time_lost_s": numbers["lost_s"],
    }


def slow_computer(figures: Mapping[str, Any], rate: float) -> list[str]:
    """Return a note if the bus was slower than `rate` [Hz], the control rate, but could carry it.

    The bus of a rehearsal without faults is then slow by its computer alone.
    """
    found, possible = (figures.get(name) for name in ("bus_rate_hz", "bus_rate_possible_hz"))
    if None in (found, possible) or found >= SLOWEST * rate or possible < rate:
        return []
    return [
        f"this computer was too slow for the servo bus: {found:.0f} Hz of {rate:.0f} Hz; "
        "see docs/preflight.md, Rehearsal"
    ]


def lines(figures: Mapping[str, Any]) -> list[str]:
    """Return one line per device for the terminal."""

    def shown(*names: str) -> str:
        return ", ".join(f"{n.replace('_', ' ')} {figures[n]:g}" for n in names if n in figures)

    groups = {
        "servo bus": ("bus_rate_hz", "bus_rate_possible_hz", "bus_cycle_ms", "bus_cycle_max_ms"),
        "mocap": ("mocap_rate_hz", "mocap_latency_ms", "mocap_latency_p99_ms"),
        "autopilot": (
            *("setpoint_rate_hz", "round_trip_ms"),
            *("serial_to_autopilot_kbyte_s", "serial_from_autopilot_kbyte_s"),
        ),
        "plant": ("plant_ticks_late", "plant_time_lost_s"),
    }
    found = {name: shown(*keys) for name, keys in groups.items()}
    return [f"{name:<10} {text}" for name, text in found.items() if text]


def free_udp_port() -> int:
    """Return a UDP port of 127.0.0.1 that is free, and the next one, too."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first:
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second:
                try:
                    second.bind(("127.0.0.1", port + 1))
                except OSError:
                    continue
                return port
