"""docs/hardware.md: its picture is drawn, its limits and parameters are those of the code."""

import importlib.util
import math
from pathlib import Path

import yaml

from uam_sim_bridge.devices.mocap import calibration, measurement
from uam_sim_bridge.devices.mocap.calibration import ENTRIES
from uam_sim_bridge.devices.mocap.library_source import SYSTEMS

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/hardware.md").read_text()


def test_the_nominal_calibrations_have_the_entries_of_the_page():
    for file in (ROOT / "config/mocap").glob("*.yaml"):
        assert set(yaml.safe_load(file.read_text())) == ENTRIES - {"measured"}
    assert all(f"| `{entry}` |" in PAGE for entry in ENTRIES)


def test_the_page_names_every_system_and_the_limits_of_the_code():
    assert all(f"`{system}`" in PAGE for system in SYSTEMS if system != "mock")
    limits = (
        f"{1e3 * measurement.MOVED:g} mm, {math.degrees(measurement.TURNED):g}°",
        f"at least {calibration.SHORTEST:g} m",
        f"{1e2 * calibration.STEEPEST:g} cm: a floor",
        f"{math.degrees(calibration.TILT):g}°, {math.degrees(calibration.TURN):g}°",
        f"level | {math.degrees(calibration.DEFINED_TILT):g}° |",
        f"−{-calibration.LOWEST:g} to {calibration.HIGHEST:g} m",
    )
    for limit in limits:
        assert limit in PAGE, limit


def test_the_picture_is_drawn(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")  # it shares the strokes of draw_frames
    spec = importlib.util.spec_from_file_location("draw_mocap", ROOT / "docs/draw_mocap.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.draw(tmp_path / "frames.png")
    assert (tmp_path / "frames.png").stat().st_size > 10_000
