"""`uam hand fk`: by hand, for a program, and refused in one line."""

import json
import math

import numpy as np
import pytest

from uam_lab.cli import hand
from uam_lab.cli.main import main

PLACE = ("0.15", "0", "-0.25")


def answer(capsys, *words):
    assert main(["hand", "fk", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_arm_straight_down_and_forward(capsys):
    """Mount 73 mm below the origin, 240 mm to the pivot, 30 mm to the face; 2.2 kg in all."""
    found = answer(capsys, "--joints", "0,0")
    np.testing.assert_allclose(found["position_m"], [0.0, 0.0, -0.343], atol=1e-12)
    np.testing.assert_allclose(found["orientation_wxyz"], [1, 0, 0, 0], atol=1e-12)
    # shoulder, link, servo, second link, yoke and face of the magnet [kg, m]
    parts = [
        *((0.091, 0.073), (0.095, 0.1255), (0.082, 0.173), (0.09, 0.248)),
        *((0.01, 0.322), (0.06, 0.337)),
    ]
    below = sum(mass * depth for mass, depth in parts) / 2.2
    np.testing.assert_allclose(found["centre_of_mass_m"], [0, 0, -below], atol=1e-9)
    found = answer(capsys, "--joints", "90,0", "--degrees")
    np.testing.assert_allclose(found["position_m"], [0.24, 0.0, -0.103], atol=1e-12)


def test_radians_negative_angles_and_the_range_of_a_joint(capsys):
    found = answer(capsys, "--joints", "-0.5,0.25")
    assert found["joints_rad"] == [-0.5, 0.25] and found["beyond_range"] == []
    expected = -0.1 * math.sin(0.5) - 0.14 * math.sin(0.25)
    assert found["position_m"][0] == pytest.approx(expected)
    assert answer(capsys, "--joints=0,130", "--degrees")["beyond_range"] == ["alpha_2"]
    assert main(["hand", "fk", "--joints", "0,0"]) == 0
    assert "position_m         0.000000 0.000000 -0.343000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--joints", "1"], "--joints: 1 angles, s500_arm has 2 joints: alpha_1, alpha_2"),
        (["--joints", "1,nan"], "'1,nan' is no list of angles"),
        (["--joints", "1,x"], "'1,x' is no list of angles"),
        (["--joints", "1,1e308"], "'1,1e308' is no list of angles"),
        (["--joints", "0,0", "--vehicle", "none"], "unknown vehicle 'none'"),
        (["--joints", "0,0", "--position", "0", "0", "0"], "--position: is of ik"),
    ],
)
def test_wrong_use_is_refused_in_one_line(capsys, words, text):
    try:
        assert main(["hand", "fk", *words]) == 2
    except SystemExit as ended:
        assert ended.code == 2
    error = capsys.readouterr().err
    assert text in error and error.count("\n") == 1


def test_a_vehicle_without_a_hand(tmp_path, capsys):
    from uam_control.settings import configuration

    folder = configuration.root() / "vehicle"
    (tmp_path / "parts").mkdir()
    for file in (folder / "parts").iterdir():
        text = file.read_text().replace('<site name="magnet_face"', '<site name="nose"')
        (tmp_path / "parts" / file.name).write_text(text)
    (tmp_path / "own.xml").write_text((folder / "s500_arm.xml").read_text())
    text = (folder / "s500_arm.yaml").read_text().replace("model: s500_arm.xml", "model: own.xml")
    named, text = text, text.replace("end_effector: magnet_face", "")
    (tmp_path / "own.yaml").write_text(text)
    words = ["hand", "fk", "--vehicle", str(tmp_path / "own.yaml"), "--joints", "0,0"]
    assert main(words) == 2
    assert "no end effector: name a site of own.xml" in capsys.readouterr().err
    (tmp_path / "own.yaml").write_text(named)
    assert main(words) == 2
    assert "own.xml: no site 'magnet_face'" in capsys.readouterr().err
    (tmp_path / "own.yaml").write_text(text + "end_effector: nose\n")
    assert main(words) == 0


def test_angles_for_a_place_and_back(capsys):
    """0.1 m and 0.14 m to the pivot: forward and down by a right angle; the face 30 mm below."""
    place = ["--position", "0.1", "0", str(-0.073 - 0.14 - 0.03)]
    assert main(["hand", "ik", *place, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["distance_m"] < 1e-6 and not found["beyond_range"]
    first, second = found["joints_rad"]
    assert 0.1 * math.sin(first) + 0.14 * math.sin(first + second) == pytest.approx(0.1)
    assert 0.1 * math.cos(first) + 0.14 * math.cos(first + second) == pytest.approx(0.14)
    # 0.24 m is the longest reach: from 1 m straight below the mount the face is 0.73 m away
    assert main(["hand", "ik", "--position", "0", "0", "-1.073", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["distance_m"] == pytest.approx(0.73)


def test_the_workspace(tmp_path, capsys):
    """A planar arm of 0.1 m and 0.14 m, straight down to both sides of the mount."""
    picture = tmp_path / "reach.png"
    assert main(["hand", "workspace", "--json", "--out", str(picture)]) == 0
    found = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(found["lowest_m"], [-0.24, 0.0, -0.343], atol=2e-3)
    assert found["highest_m"][:2] == pytest.approx([0.24, 0.0], abs=2e-3)
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("file", "why"), [("reach.txt", "ends in .png"), (".", "ends in .png"), ("no/a.png", "folder")]
)
def test_a_picture_that_cannot_be_written(tmp_path, capsys, file, why):
    assert main(["hand", "workspace", "--out", str(tmp_path / file)]) == 2
    error = capsys.readouterr().err
    assert why in error and error.count("\n") == 1


def test_the_example_of_the_help_is_within_reach(capsys):
    assert f"ik --position {' '.join(PLACE)} " in hand.__doc__
    assert main(["hand", "ik", "--position", *PLACE]) == 0


def test_what_an_action_needs_is_told(capsys):
    for action, option in (("fk", "--joints"), ("ik", "--position")):
        assert main(["hand", action]) == 2
        assert f"{action} needs {option}" in capsys.readouterr().err
