"""PX4's log (ULog) beside ours: frames, units and the alignment of the clocks."""

import struct
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from uam_lab.report.build import px4_log_of
from uam_lab.report.facts import px4_log
from uam_lab.report.facts.px4_log import UnreadableUlog, align, read

AHEAD = 3.2  # [s] PX4's time at mission time 0
FIELDS = {
    "vehicle_rates_setpoint": ("roll", "pitch", "yaw", ("thrust_body", 3)),
    "vehicle_attitude": (("q", 4),),
    "vehicle_angular_velocity": (("xyz", 3),),
    "vehicle_local_position": ("x", "y", "z", "xy_valid", "z_valid"),
    "actuator_motors": (("control", 12),),
}


def message(kind: bytes, content: bytes) -> bytes:
    return struct.pack("<Hc", len(content), kind) + content


def ulog(topics: dict[str, list[tuple[float, ...]]]) -> bytes:
    """A ULog of rows (time [s], values): header, flags, formats, subscriptions, data."""
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    out += message(b"P", struct.pack("<B17sf", 17, b"float THR_MDL_FAC", 0.5))
    for name in topics:
        fields = [(f, 1) if isinstance(f, str) else f for f in FIELDS[name]]
        texts = [f"float{f'[{n}]' if n > 1 else ''} {field};" for field, n in fields]
        out += message(b"F", f"{name}:uint64_t timestamp;{''.join(texts)}".encode())
    for number, name in enumerate(topics):
        out += message(b"A", struct.pack("<BH", 0, number) + name.encode())
    for number, rows in enumerate(topics.values()):
        for time, *values in rows:
            stamp = round(1e6 * time)
            content = struct.pack(f"<HQ{len(values)}f", number, stamp, *values)
            out += message(b"D", content)
    return out


class Table(dict):
    """A flight: columns by name, and their time."""

    time = np.arange(-2.0, 12.0, 0.004)


def flown() -> Table:
    time, table = Table.time, Table()
    table["setpoint.thrust"] = np.where((time > 0.0) & (time < 9.0), 0.5, 0.0)
    table["setpoint.rate_x"] = 0.4 * np.sin(3.0 * time) * np.exp(-((time - 4.0) ** 2))
    table["setpoint.rate_y"] = 0.2 * np.cos(5.0 * time) * np.exp(-((time - 6.0) ** 2))
    table |= {f"estimate.{axis}": np.full_like(time, 2.0) for axis in "xyz"}
    return table


def setpoints(table: Table) -> list[tuple[float, ...]]:
    """As PX4 logs them: at 50 Hz, FRD."""
    rows = zip(
        table.time + AHEAD,
        *(table[name] for name in ("setpoint.rate_x", "setpoint.rate_y", "setpoint.thrust")),
        strict=True,
    )
    return [(t, x, -y, 0.0, 0.0, 0.0, -thrust) for t, x, y, thrust in rows][::5]


def test_the_clocks_are_aligned_by_the_setpoints_and_the_frames_are_ours(tmp_path):
    pytest.importorskip("pyulog")
    half = np.radians(60.0) / 2.0  # heading 60 degrees from north to east: 30 from east to north
    table, file = flown(), tmp_path / "px4.ulg"
    motors = (0.1, 0.2, 0.3, 0.4, *[np.nan] * 8)
    file.write_bytes(
        ulog(
            {
                "vehicle_rates_setpoint": setpoints(table),
                "vehicle_attitude": [(3.2, np.cos(half), 0.0, 0.0, np.sin(half))],
                "vehicle_angular_velocity": [(4.2, 1.0, 2.0, 3.0)],
                "vehicle_local_position": [
                    (4.2, -5e6, 7.0, 9.0, 0, 0),  # before it is valid
                    (5.2, 1.5, 2.25, 403.0, 1, 1),
                ],
                "actuator_motors": [(5.2, *motors)],
            }
        )
    )
    log = read(file, table)
    assert log.offset == pytest.approx(-AHEAD, abs=0.013)  # PX4 logs every 20 ms
    assert log.correlation > 0.95

    def at(name: str) -> float:
        time, values = log.columns[name]
        return values[0]

    assert log.columns["estimate.roll"][0][0] == pytest.approx(0.0, abs=0.013)
    yaw, pitch, roll = (at(f"estimate.{axis}") for axis in ("yaw", "pitch", "roll"))
    assert np.degrees([yaw, pitch, roll]) == pytest.approx([30.0, 0.0, 0.0], abs=1e-4)
    assert [at(f"estimate.{axis}_dot") for axis in ("roll", "pitch", "yaw")] == [1.0, -2.0, -3.0]
    # z: its origin is 405 m away, in a station's altitude
    assert [at(f"estimate.{axis}") for axis in "xyz"] == [2.25, 1.5, 2.0]
    assert log.origins == {"estimate.z": 405.0}
    assert [name for name in log.columns if name.startswith("rotor")] == [
        f"rotor_{i}.command" for i in (1, 2, 3, 4)
    ]
    # 0.5 u^2 + 0.5 u = 0.3
    assert at("rotor_3.command") == pytest.approx(np.sqrt(0.85) - 0.5, abs=1e-6)


@pytest.mark.parametrize("ahead", [-7.0, 0.0, 250.0])
def test_any_difference_of_the_clocks_is_found(ahead):
    table = flown()
    columns = {name: (table.time + ahead, values) for name, values in table.items()}
    offset, correlation = align(table, columns)
    assert offset == pytest.approx(-ahead, abs=px4_log.STEP)
    assert correlation == pytest.approx(1.0, abs=1e-3)


def test_what_cannot_be_read_is_said_in_one_line(tmp_path, monkeypatch):
    pytest.importorskip("pyulog")
    file, series = tmp_path / "px4.ulg", SimpleNamespace()
    assert px4_log_of(tmp_path, series) == (None, "")
    file.write_bytes(b"no log")
    found, why = px4_log_of(tmp_path, series)
    assert found is None
    assert "no readable ULog" in why
    with pytest.raises(UnreadableUlog, match="no readable ULog"):
        px4_log_of(tmp_path, series, file)
    file.write_bytes(ulog({"actuator_motors": []}))
    with pytest.raises(UnreadableUlog, match="vehicle_rates_setpoint"):
        read(file, series)
    monkeypatch.setitem(sys.modules, "pyulog", None)
    assert px4_log_of(tmp_path, series) == (None, px4_log.MISSING)
