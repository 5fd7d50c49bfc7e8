"""Frames, URDF, transforms and markers, without ROS running."""

import hashlib
import json
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

import geometry_msgs
import mujoco
import numpy as np
import pytest
import view_files
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from visualization_msgs.msg import Marker

from uam_control.maths.rotations import matrix_from_quaternion, quaternion_from_euler
from uam_control.mission import load_scenario
from uam_lab.cockpit.scene_markers import PATH_POINTS, PATH_STEP, FlownPath, Markers, ReferencePath
from uam_lab.experiments.budget.shuttle import CYCLE, shuttle
from uam_lab.records.recording.bag import schema
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_msgs_py.messages import tf_message
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.messages.tf_message import Transform, transforms_message
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.frames import box, frames, hanging
from uam_sim_bridge.plant.gripper import FINGERS
from uam_sim_bridge.plant.urdf import BASE_LINK, urdf
from uam_sim_bridge.plant.vehicle import SWING

VEHICLE = Vehicle.load()
MODEL = VEHICLE.compile(0.0)
JOINTS = {"alpha_1": 0.4, "alpha_2": -0.7, SWING: 0.2}


@pytest.mark.parametrize(
    ("vehicle", "ends", "moving"),
    [("s500_arm", {"magnet"}, {SWING}), ("s500_gripper", {"gripper_hand", *FINGERS}, {*FINGERS})],
)
def test_the_frames_are_where_mujoco_has_them(vehicle, ends, moving):
    """Joints at 0.4, -0.7, 0.2 rad, fingers 30 mm from the middle."""
    model = Vehicle.load(vehicle).compile(0.0)
    data, joints = mujoco.MjData(model), JOINTS | dict.fromkeys(FINGERS, 0.03)
    data.qpos[0:3], data.qpos[3:7] = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    hung = frames(model)
    assert {frame.joint for frame in hung} == {"", "alpha_1", "alpha_2", *moving}
    for name in {frame.joint for frame in hung} - {""}:
        data.qpos[model.joint(name).qposadr[0]] = joints[name]
    mujoco.mj_kinematics(model, data)
    found = {BASE_LINK: (np.zeros(3), np.eye(3))}
    for frame in hung:
        position, turned = found[frame.parent]
        way, turn = frame.moved(joints.get(frame.joint, 0.0))
        found[frame.name] = position + turned @ way, turned @ matrix_from_quaternion(turn)
        body = data.body(frame.name)
        assert found[frame.name][0] == pytest.approx(body.xpos, abs=1e-12)
        assert found[frame.name][1].ravel() == pytest.approx(body.xmat, abs=1e-12)
    assert set(found) == {BASE_LINK, "shoulder", "link_1", "link_2", *ends}


def test_the_face_of_a_hanging_magnet_is_level():
    alpha, pitch = np.array([0.3, 1.1]), 0.15
    angles = {"alpha_1": alpha[0], "alpha_2": alpha[1], SWING: hanging(pitch, alpha)}
    turned = matrix_from_quaternion(quaternion_from_euler(np.array([0.0, pitch, 0.0])))
    for frame in frames(MODEL):
        if frame.joint:
            turned = turned @ matrix_from_quaternion(frame.moved(angles[frame.joint])[1])
    assert turned == pytest.approx(np.eye(3), abs=1e-12)


def test_the_urdf_shows_body_rotors_arm_and_magnet_in_the_frames_of_tf():
    robot = ElementTree.fromstring(urdf(VEHICLE))
    links = {link.get("name"): link for link in robot.iter("link")}
    assert set(links) == {BASE_LINK, *(frame.name for frame in frames(MODEL))}
    assert all(link.find("visual") is not None for link in links.values())
    discs = [c for c in links[BASE_LINK].iter("cylinder") if float(c.get("radius")) > 0.1]
    assert len(discs) == 4
    for joint in robot.iter("joint"):
        (frame,) = [f for f in frames(MODEL) if f.name == joint.find("child").get("link")]
        assert joint.find("parent").get("link") == frame.parent


def test_transforms_are_decoded_as_they_were_sent(tmp_path):
    """By a reader that has only the schema, through a file."""
    sent = [
        (3_000_000_004, "world", "base_link", np.array([1.0, 2.0, 3.0]), np.array([1.0, 0, 0, 0])),
        (5, "base_link", "link_1", np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.1, 0.2, 0.8])),
    ]
    name = "tf2_msgs/msg/TFMessage"
    log = BoundedLog(tmp_path / "log.mcap", limit=0.0)
    channel = log.add_channel("/tf", name, schema(name), {})
    log.write(channel, 7, 7, transforms_message([Transform(*entry) for entry in sent]), 1)
    log.close()
    content = BytesIO((tmp_path / "log.mcap").read_bytes())
    reader = make_reader(content, decoder_factories=[DecoderFactory()])
    ((_, _, _, message),) = reader.iter_decoded_messages()
    for (stamp, parent, child, position, quaternion), found in zip(
        sent, message.transforms, strict=True
    ):
        time, transform = found.header.stamp, found.transform
        place, turn = transform.translation, transform.rotation
        assert time.sec * 10**9 + time.nanosec == stamp
        assert (found.header.frame_id, found.child_frame_id) == (parent, child)
        assert (place.x, place.y, place.z) == tuple(position)
        assert (turn.w, turn.x, turn.y, turn.z) == tuple(quaternion)


def test_the_hash_of_the_type_is_that_of_its_description():
    """As rosidl computes it: over the description as JSON, without default values."""
    share = next(
        p / "share"
        for p in Path(geometry_msgs.__file__).parents
        if (p / "share/geometry_msgs/msg").is_dir()
    )
    known = json.loads((share / "geometry_msgs/msg/TransformStamped.json").read_text())
    element = known["type_description_msg"]
    parts = [element["type_description"], *element["referenced_type_descriptions"]]
    for part in parts:
        for field in part["fields"]:
            del field["default_value"]
    kind = {
        "type_id": tf_message.NESTED_SEQUENCE,
        "capacity": 0,
        "string_capacity": 0,
        "nested_type_name": "geometry_msgs/msg/TransformStamped",
    }
    own = {
        "type_name": "tf2_msgs/msg/TFMessage",
        "fields": [{"name": tf_message.FIELD, "type": kind}],
    }
    whole = {
        "type_description": own,
        "referenced_type_descriptions": sorted(parts, key=lambda part: part["type_name"]),
    }
    assert hashlib.sha256(json.dumps(whole).encode()).digest() == tf_message.HASH


def markers(status, payload=True, ahead=None, scenario="pick_and_place"):
    maker = Markers(load_scenario(scenario), box(MODEL, "magnet_face"), box(MODEL, "payload"))
    path = np.zeros((3, 3)) if ahead is None else ahead
    made = maker.message(1_500_000_000, status, path, np.zeros((0, 3)), payload)
    return {marker.ns: marker for marker in made.markers}


def test_markers_show_phase_magnet_payload_and_drop_point():
    found = markers(MissionStatus(phase="pick", magnet=True))
    assert found["phase"].text == "pick" and found["phase"].header.frame_id == "base_link"
    assert found["magnet"].header.frame_id == "magnet" and found["magnet"].frame_locked
    assert found["payload"].header.frame_id == "payload"
    assert found["payload"].scale.z == pytest.approx(0.04)
    assert found["drop point"].pose.position.x == pytest.approx(0.789, abs=0.01)
    assert found["reference path"].action == Marker.ADD and len(found["reference path"].points) == 3
    assert found["flown path"].action == Marker.DELETE, "a line needs two points"
    assert set(found) == view_files.rviz()[2], "those that the RViz configuration switches on"
    off = markers(MissionStatus(phase="pick"))["magnet"].color
    assert off != found["magnet"].color
    assert "payload" not in markers(MissionStatus(), payload=False)
    assert "drop point" not in markers(MissionStatus(), scenario="hover")
    aborted = MissionStatus(phase="aborted", abort_reason="tilt 70 deg exceeds 60 deg")
    assert markers(aborted)["phase"].text == "tilt 70 deg exceeds 60 deg"


def test_the_reference_path_leads_from_now_to_the_landing():
    start = np.zeros(8)
    start[2] = 0.28
    path = ReferencePath(load_scenario("hover"), start)
    whole = path.ahead(0.0)
    assert whole[0] == pytest.approx(start[:3]) and whole[:, 2].max() == pytest.approx(1.0)
    assert whole[-1][2] < 0.28
    later = path.ahead(6.0)
    assert 2 <= len(later) < len(whole) and later[0][2] == pytest.approx(1.0)
    assert len(path.ahead(1e3)) == 0


def test_of_the_path_of_hours_the_next_minutes_are_shown(tmp_path):
    """All points of it, twice a second, took most of a core."""
    file = tmp_path / "hours.yaml"
    file.write_text(shuttle(7200.0))
    path = ReferencePath(load_scenario(str(file)), np.zeros(8))
    for time in (0.0, 4 * CYCLE, 2 * CYCLE, 3000.0):
        points, first = path.ahead(time), int(CYCLE / PATH_STEP)
        assert len(points) == PATH_POINTS
        assert points[first : 2 * first] == pytest.approx(points[2 * first : 3 * first])
    assert 1 < len(path.ahead(7100.0)) < PATH_POINTS


def test_a_long_flown_path_is_thinned_out():
    path = FlownPath()
    for tick in range(80_000):
        path.add(tick * 40_000_000, np.array([float(tick), 0.0, 0.0]))
    points = path.points
    assert 1000 <= len(points) <= 2001
    assert points[0][0] == 0.0 and points[-1][0] > 78_000.0
