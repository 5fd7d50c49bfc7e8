"""`uam calibrate-mocap`: two places on the floor → calibration, residuals and refusals."""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mocap_room import MocapRoom
from tracked_vehicle import RATE, STANDING, TrackedBody, ahead, moving, recorded, standing

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
)
from uam_lab.cli.main import main
from uam_sim_bridge.devices.mocap import calibration as calibrations
from uam_sim_bridge.devices.mocap import measurement
from uam_sim_bridge.devices.mocap.calibration import fit
from uam_sim_bridge.devices.mocap.frame import BodyPose, MocapError
from uam_sim_bridge.devices.mocap.measurement import angle_between, places, still
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.frames import standing_height

angles = st.floats(-3.1, 3.1)
NOISE = (0.0004, math.radians(0.1))


def fitted(body, at, heading, distance=1.0, up=None, pivot=(0.0, 0.0), world=0.0, **second):
    """The calibration from a level place and one `distance` ahead; second: of that place."""
    first = still(recorded(body, standing(at, heading)), "first place")
    turned = heading + second.get("turned", 0.0)
    at, q = standing(ahead(at, heading, distance), turned, second.get("tilt", (0.0, 0.0)))
    place = at + np.array([0.0, 0.0, second.get("higher", 0.0)]), q
    return fit(
        first, still(recorded(body, place), "second place"), up or body.up, world, STANDING, pivot
    )


@given(
    angles, angles, st.tuples(angles, angles), st.sampled_from("yz"), angles,
    st.floats(-0.09, 0.3), st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
)  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_the_truth_is_found_wherever_the_vehicle_stands_and_the_body_was_made(
    heading, made_heading, at, up, world, height, pivot
):
    made_at = quaternion_from_euler(np.array([0.05, -0.1, made_heading]))
    body = TrackedBody("uam", up, tuple(made_at), (*pivot, height))
    found = fitted(body, at, heading, pivot=pivot, world=world)
    np.testing.assert_allclose(found.pivot, body.pivot, atol=1e-6)
    flown = np.array([0.3, -2.0, 1.1]), quaternion_from_euler(np.array([0.2, -0.3, 2.0]))
    seen = body.seen(*flown)
    position, turned = found.convert(BodyPose(np.array(seen[0]), np.roll(np.array(seen[1]), 1)))
    about_up = quaternion_from_euler(np.array([0.0, 0.0, world]))
    np.testing.assert_allclose(position, matrix_from_quaternion(about_up) @ flown[0], atol=1e-6)
    assert angle_between(turned, quaternion_multiply(about_up, flown[1])) < 1e-6


def test_noise_of_a_tracker_leaves_a_tenth_of_a_degree():
    body = TrackedBody("uam", "y", (1.0, 0, 0, 0), (0.0, 0.0, 0.05))
    first = still(recorded(body, standing((0, 0), 0.7), noise=NOISE, seed=1), "first place")
    place = standing(ahead((0, 0), 0.7, 1.0), 0.7)
    second = still(recorded(body, place, noise=NOISE, seed=2), "second place")
    found = fit(first, second, "y", 0.0, STANDING, (0.0, 0.0))
    exact = calibrations.load("motive_y_up").body
    assert math.degrees(angle_between(np.array(found.body), np.array(exact))) < 0.1
    assert found.pivot[2] == pytest.approx(0.05, abs=2e-4)
    m = found.measured
    assert m["distance_m"] == pytest.approx(1.0, abs=1e-3) and m["poses"] == "480"
    assert 0.2 < m["spread_mm"] < 1.5 and 0.05 < m["wobble_deg"] < 0.4


def test_the_residuals_are_those_of_the_second_place():
    body = TrackedBody("uam")
    found = fitted(
        body, (1, 2), 0.4, 1.5, turned=math.radians(2), tilt=(math.radians(0.5), 0), higher=0.01
    ).measured
    assert found["distance_m"] == pytest.approx(1.5)
    assert found["heading_difference_deg"] == pytest.approx(2.0, abs=1e-6)
    assert found["tilt_difference_deg"] == pytest.approx(0.5, abs=1e-6)
    assert found["height_difference_m"] == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize(
    ("second", "reason"),
    [
        ({"distance": 0.3}, "moved 0.30 m between the places, at least 0.5 m"),
        ({"higher": 0.05}, r"moved \+0.050 m upwards"),
        ({"turned": 0.1}, r"turned by \+5.7 deg between the places, at most 3 deg"),
        ({"tilt": (0.0, 0.05)}, "tilted by 2.86 deg between the places, at most 1 deg"),
    ],
)
def test_a_second_place_without_sense_is_refused(second, reason):
    with pytest.raises(MocapError, match=reason):
        fitted(TrackedBody("uam"), (0.0, 0.0), 0.5, **second)


@pytest.mark.parametrize("heading", [0.5, 2.0, -1.0])
def test_the_wrong_axis_up_is_refused(heading):
    with pytest.raises(MocapError, match="axis point up"):
        fitted(TrackedBody("uam", "y"), (0.0, 0.0), heading, up="z")
    with pytest.raises(MocapError, match="axis point up"):
        fitted(TrackedBody("uam", "z"), (0.0, 0.0), heading, up="y")


def test_a_vehicle_on_its_side_and_a_floor_that_is_none_are_refused():
    lying = TrackedBody("uam", "y", tuple(quaternion_from_euler(np.array([1.5, 0.0, 0.0]))))
    with pytest.raises(MocapError, match="tilted by 86 deg while the vehicle stands level"):
        fitted(lying, (0, 0), 0.0)
    with pytest.raises(MocapError, match="ground plane on the floor"):
        fitted(TrackedBody("uam", "y", pivot=(0, 0, 0.8)), (0, 0), 0.0)
    with pytest.raises(MocapError, match="-0.28 m above base_link, -0.1 to 0.5 m is allowed"):
        fitted(TrackedBody("uam", "y"), (0, 0), 0.0, up="z")  # a move along x alone


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ({"count": 30}, "first place: 30 poses, at least 60"),
        ({"noise": (0.01, 0.0)}, "first place: the vehicle moved during the measurement"),
        ({"noise": (0.0, 0.02)}, "first place: the vehicle moved during the measurement"),
        ({"drift": (0.004, 0.0, 0.0)}, "moved during the measurement, 4.0 mm and 0.00 deg"),
    ],
)
def test_a_vehicle_that_moves_is_refused(how, reason):
    with pytest.raises(MocapError, match=reason):
        still(recorded(TrackedBody("uam"), standing((0, 0), 0.0), **how), "first place")


def recording(noise=NOISE):
    """Two seconds still, one second on the way, two seconds still."""
    body = TrackedBody("uam", "y", (1.0, 0, 0, 0), (0.02, 0.0, 0.06))
    end = ahead((0.2, 0.1), 0.3, 1.0)
    poses = recorded(body, standing((0.2, 0.1), 0.3), 240, 10.0, noise, seed=1)
    poses += moving(body, (0.2, 0.1), end, 0.3, 120, 12.0)
    return poses + recorded(body, standing(end, 0.3), 240, 13.0, noise, seed=2)


def test_the_places_of_a_recording_are_found():
    found = places(recording(), 1.0)
    assert [len(one) for one in found] == [pytest.approx(192, abs=4)] * 2
    assert found[0][-1].time < 12.0 and found[1][0].time > 13.0


@given(st.integers(0, 2**20))
@settings(max_examples=5, deadline=None)
def test_a_recording_is_written_and_read_back(tmp_path_factory, seed):
    body = TrackedBody("uam")
    poses = recorded(body, standing((1, 2), 0.3), 20, 1.7e9, NOISE, seed=seed)
    file = tmp_path_factory.getbasetemp() / "raw.csv"
    measurement.write_poses(file, poses)
    for (stamp, one), (read_stamp, read) in zip(poses, measurement.read_poses(file), strict=True):
        assert read_stamp == pytest.approx(stamp, abs=1e-6)
        np.testing.assert_allclose(read.position, one.position, atol=1e-8)
        np.testing.assert_allclose(read.quaternion, one.quaternion, atol=1e-8)


HEADER = "t,x,y,z,qw,qx,qy,qz\n"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("t,x,y,\xff\n", "not a text in UTF-8"),
        ("t,x,y\n1,2,3\n", "no column z, qw, qx, qy, qz"),
        (
            "t,x,y,z,qw,qx,qy,qz\n1,2,3,4,1,0,0,zero\n",
            "line 2 column qz: 'zero' is not a finite number",
        ),
        ("t,x,y,z,qw,qx,qy,qz\n1,2,3,4,0,0,0,0\n", "line 2: not a pose"),
        ("t,x,y,z,qw,qx,qy,qz\n1,2,3,4,1,0,0,0\n1,2,3,4,1,0,0,0\n", "line 3: t does not grow"),
        (
            f"{HEADER}1,0,0,0,1,0,0,0\n2,800,0,0,1,0,0,0\n",
            "line 3: 800 m from .*; give x, y, z in m",
        ),
        (f"{HEADER}0,0,0,0,1,0,0,0\n8,0,0,0,1,0,0,0\n", "8 s apart, .*; give times in seconds"),
    ],
)
def test_a_recording_that_is_none_is_refused(tmp_path, content, reason):
    file = tmp_path / "raw.csv"
    file.write_bytes(content.encode("latin-1"))
    with pytest.raises(MocapError, match=reason):
        measurement.read_poses(file)


def test_the_command_calibrates_from_a_recording(tmp_path, capsys):
    log, out = tmp_path / "raw.csv", tmp_path / "lab.yaml"
    measurement.write_poses(log, recording())
    given = ["--log", str(log), "--out", str(out), "--pivot", "0.02", "0"]
    assert main(["calibrate-mocap", *given]) == 0
    assert "moved 1.00 m" in capsys.readouterr().out
    found = calibrations.load(str(out))
    np.testing.assert_allclose(found.pivot, (0.02, 0.0, 0.06), atol=5e-4)
    assert found.measured["poses"] == pytest.approx(384, abs=8)


def test_the_command_refuses_in_one_line(tmp_path, capsys):
    log, out = tmp_path / "raw.csv", tmp_path / "lab.yaml"
    measurement.write_poses(log, recorded(TrackedBody("uam"), standing((0, 0), 0.0)))
    assert main(["calibrate-mocap", "--log", str(log), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "1 places where the vehicle stands still, 2 are needed" in said
    assert said.count("\n") == 1 and not out.exists()


def test_the_command_guides_and_measures_over_real_sockets(tmp_path, capsys, monkeypatch):
    """A person who pushes the vehicle 0.8 m ahead between the two questions."""
    heading, at = 0.4, [standing((0.1, 0.2), 0.4)]
    body = TrackedBody("uam", "y", tuple(quaternion_from_euler(np.array([0, 0, 1.0]))), (0, 0, 0.1))
    asked = []

    def person(question):
        asked.append(question)
        if len(asked) == 2:
            at[0] = standing(ahead((0.1, 0.2), heading, 0.8), heading)
            sent, end = server.sent, time.monotonic() + 60.0
            while server.sent < sent + 5 and time.monotonic() < end:  # those of the first place
                time.sleep(0.01)
        return ""

    monkeypatch.setattr("builtins.input", person)
    out, raw = tmp_path / "lab.yaml", tmp_path / "raw.csv"
    with MocapRoom([body, TrackedBody("box")], lambda _: {"uam": at[0]}) as server:
        # It measures for a second of the server's frames: a stalled test has all of them. Without
        # frames the wall's clock ends it.
        end = time.monotonic() + 60.0
        clock = SimpleNamespace(monotonic=lambda: max(server.sent / RATE, time.monotonic() - end))
        monkeypatch.setattr(measurement, "time", clock)
        given = ["--port", str(server.port), "--out", str(out), "--save", str(raw)]
        assert main(["calibrate-mocap", *given, "--duration", "1"]) == 0, capsys.readouterr().err
        assert main(["calibrate-mocap", *given, "--body", "drone"]) == 2
    said = capsys.readouterr()
    assert "level on the floor" in asked[0] and "nose first" in asked[1]
    assert "no rigid body 'drone'" in said.err and "there are: box, uam" in said.err
    found = calibrations.load(str(out))
    np.testing.assert_allclose(found.pivot, (0, 0, 0.1), atol=1e-5)
    assert found.measured["distance_m"] == pytest.approx(0.8, abs=1e-4)
    assert len(measurement.read_poses(raw)) > RATE / 2


def test_the_standing_height_is_that_of_the_landing_gear():
    assert standing_height(Vehicle.load().compile(0.0)) == pytest.approx(STANDING, abs=1e-9)
