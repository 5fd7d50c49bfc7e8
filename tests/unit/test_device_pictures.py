"""The pictures of servos and autopilot in the docs."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_pictures_are_drawn_and_shown(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")  # it shares the strokes of draw_frames
    spec = importlib.util.spec_from_file_location("draw_devices", ROOT / "docs/draw_devices.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    pictures = tmp_path / "arm.png", tmp_path / "autopilot.png"
    module.draw(*pictures)
    assert all(one.stat().st_size > 10_000 for one in pictures)
    for page, picture in (("hardware", "arm_frames"), ("autopilot", "autopilot_frames")):
        assert f"images/{picture}.png" in (ROOT / f"docs/{page}.md").read_text()
        assert (ROOT / f"docs/images/{picture}.png").exists()
