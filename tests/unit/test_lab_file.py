"""The lab file: what it describes, and every mistake named in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from arm_rig import LinePort
from hypothesis import given
from hypothesis import strategies as st
from servo_shafts import StillShaft

from uam_control.settings import configuration
from uam_lab.flights.vehicle.lab_file import (
    REQUIRED,
    LabError,
    Room,
    load_lab,
    settings_of,
    template,
)
from uam_lab.flights.vehicle.vehicle_nodes import parameters
from uam_lab.records.results.result_folder import ResultFolder
from uam_sim_bridge.devices.dynamixel.chain import ArmError
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedServo, ServoLine
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.devices.magnet.lines import LineParameters, SwitchingParameters
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters

MISSING = object()
GRIPPER = {"through": "autopilot", "magnet": "gripper", "magnet_output": 2}


def written(folder: Path, **changes: Any) -> Path:
    """A copy of the template; changes: section__entry=value, MISSING removes the entry."""
    document = yaml.safe_load(template())
    for name, value in changes.items():
        where, (*sections, key) = document, name.split("__")
        for section in sections:
            where = where[section]
        where.pop(key) if value is MISSING else where.update({key: value})
    file = folder / "my_lab.yaml"
    file.write_text(yaml.safe_dump(document))
    return file


def refusal(file: Path) -> str:
    """The text of the refusal: one line that names the file."""
    with pytest.raises(LabError) as refused:
        load_lab(file)
    text = str(refused.value)
    assert "\n" not in text and "my_lab.yaml" in text
    return text


def test_the_template_is_a_lab_with_the_defaults_of_the_drivers():
    lab = load_lab("s500_lab")
    assert lab.vehicle.name == "s500_arm" and lab.arm.joint_names == lab.vehicle.joint_names
    assert lab.room == Room((-2.0, -2.0, -0.1), (2.0, 2.0, 2.5))
    assert lab.mocap == replace(MocapParameters(), server="192.168.1.5")
    assert (lab.magnet.line, lab.magnet.switching) == (LineParameters(), SwitchingParameters())
    assert lab.arm_file == lab.file and lab.nodes == {} and lab.imu == "autopilot"


def test_the_template_shows_every_entry():
    """Whoever copies it sees what there is."""
    document = yaml.safe_load(template())
    assert set(document["mocap"]) == set(MocapParameters.specs())
    shown = set(LineParameters.specs()) | set(SwitchingParameters.specs()) | {"through"}
    assert set(document["magnet"]) == shown


def test_the_room_is_the_supervisors_geofence_and_nothing_starts_by_itself(tmp_path):
    lab = load_lab(written(tmp_path, room__x=[-1.5, 3.0], nodes={"mission": {"battery_land": 0.3}}))
    flown = settings_of(lab)
    mission = flown.profile.sets["mission"]
    assert (mission.geofence_low, mission.geofence_high) == ((-1.5, -2.0, -0.1), (3.0, 2.0, 2.5))
    assert mission.battery_land == 0.3
    assert not flown.auto_start and flown.clock == "realtime" and flown.imu == "autopilot"


def test_an_autopilot_of_this_computer_does_not_start_by_itself_either(tmp_path):
    assert not settings_of(load_lab(written(tmp_path, autopilot="udp:127.0.0.1:14580"))).auto_start


def test_a_ground_station_is_connected_through_the_bridge(tmp_path):
    url = "udp:192.168.1.20:14550"
    assert settings_of(load_lab(written(tmp_path, gcs=url))).gcs == url
    assert settings_of(load_lab(written(tmp_path))).gcs == ""


def test_the_bridge_speaks_to_the_system_of_the_lab_file(tmp_path):
    for changes, system in (({}, 1), ({"autopilot_system": 7}, 7)):
        lab = load_lab(written(tmp_path, **changes))
        found = parameters(lab, settings_of(lab), ResultFolder(tmp_path / "out"))
        assert found["mavlink_bridge"]["autopilot_system"] == system


def test_the_layout_is_that_of_the_file(tmp_path):
    lab = load_lab(
        written(tmp_path, layout="fused", nodes={"flight_controller": {"inner_rate": 50.0}})
    )
    flown = settings_of(lab)
    assert lab.fused and flown.fused and flown.parameters["flight_controller"]["inner_rate"] == 50.0
    assert not load_lab(written(tmp_path, layout="separate")).fused


@pytest.mark.parametrize("section", REQUIRED)
def test_a_missing_section_is_named_with_the_required_ones(tmp_path, section):
    text = refusal(written(tmp_path, **{section: MISSING}))
    assert f"{section}: missing; required are: {', '.join(REQUIRED)}" in text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"wind": 3}, "wind: unknown; allowed: vehicle, scenario,"),
        ({"vehicle": "glider"}, "vehicle: unknown vehicle 'glider'; there are: hexa_arm"),
        ({"scenario": "dance"}, "dance"),
        ({"profile": ["fast"]}, "profile: no profiles/fast.yaml in the configuration"),
        ({"profile": [3]}, "profile: a name, a file, or a list of them expected, got [3]"),
        ({"profile": "px4_position_servos"}, "px4_position_servos"),
        ({"autopilot": "builtin"}, "autopilot: 'builtin' is no link; allowed: udp:HOST:PORT"),
        ({"autopilot": "serial:/dev/ttyS0"}, "autopilot: "),
        ({"gcs": "udp:no port"}, "gcs: "),
        ({"gcs": "serial:/dev/ttyUSB0:57600"}, "is no link to a ground station: udp:HOST:PORT"),
        ({"imu": "both"}, "imu: 'both' is not one of autopilot, topic"),
        ({"layout": "one"}, "layout: 'one' is not one of separate, fused"),
        ({"nodes": {"flight_controller": {"inner_rate": 50.0}}}, "only the fused layout has this"),
        ({"room__x": [2.0, -2.0]}, "room.x: 2 is not below -2: [smallest, largest] expected"),
        ({"room__z": [0.0]}, "room.z: a list of 2 numbers expected"),
        ({"room__h": 2.0}, "room.h: unknown; allowed: x, y, z"),
        ({"room__z": [-0.1, 0.8]}, "scenario hover: z 1 m exceeds 0.8 m"),
        ({"mocap__bodi": "uam"}, "mocap: bodi: unknown, did you mean body"),
        ({"mocap__calibration": "none.yaml"}, "mocap: mocap file none.yaml does not exist"),
        ({"mocap__command_port": 0}, "mocap: command_port: 0 is outside 1 to 65535"),
        ({"arm__serial": "/dev/x"}, "arm.serial: unknown; allowed: device, baud_rate"),
        ({"arm": "no_arm"}, "unknown lab 'no_arm'"),
        ({"arm__baud_rate": 4500000}, "arm.baud_rate: 4500000 is not one of 9600, 57600"),
        ({"arm__baud_rate": "fast"}, "arm.baud_rate: a number expected, got 'fast'"),
        ({"mocap__source": "vrpn"}, "mocap: source: 'vrpn' is not one of natnet, motioncapture"),
        (
            {"mocap__system": "kinect"},
            "mocap: system: 'kinect' is not one of vicon, qualisys, vrpn",
        ),
        ({"mocap": "vrpn_mocap"}, "mocap: a mapping expected, got 'vrpn_mocap'"),
        ({"magnet": GRIPPER | {"magnet_output": 7}}, "magnet_output: 7 is outside 1 to 6"),
        ({"arm": {}}, "arm: has no entry"),
        (
            {"magnet__through": "wifi"},
            "magnet.through: 'wifi' is not one of gpio, autopilot, servo, none",
        ),
        ({"magnet": {"through": "none", "line": 3}}, "magnet.line: unknown; allowed: through"),
        ({"magnet": {"through": "autopilot"}}, "magnet.magnet: actuator or gripper expected"),
        ({"magnet__line": 2.5}, "magnet: line: 2.5 is no integer; allowed: 0 to 1023"),
        ({"cockpit__port": 99999}, "cockpit.port: a whole number expected, 0 to 65535, got 99999"),
        ({"autopilot_system": 0}, "autopilot_system: a whole number expected, 1 to 250, got 0"),
        (
            {"autopilot_system": "two"},
            "autopilot_system: a whole number expected, 1 to 250, got 'two'",
        ),
        ({"cockpit__host": "x"}, "cockpit.host: unknown; allowed: address, port"),
        ({"nodes": {"mujoco_sim": {"seed": 3}}}, "nodes.mujoco_sim: unknown; allowed: position_"),
        ({"nodes": {"mission": {"geofence_low": [0, 0, 0]}}}, "follows from the section room"),
        ({"nodes": {"mission": {"batery": 1.0}}}, "mission: batery: unknown"),
        ({"nodes": {"mavlink_bridge": {"gcs": ""}}}, "gcs follows from the other options"),
        ({"nodes": {"arm_driver": {"rate": -1.0}}}, "nodes.arm_driver: rate: -1.0 is outside"),
        ({"nodes": {"checklist": {"batery": 0.5}}}, "checklist: batery: unknown, did you"),
        ({"nodes": {"checklist": {"battery": 7.0}}}, "nodes.checklist: battery: 7.0 is outside"),
        ({"nodes": {"checklist": {"room_low": [0.0, 0.0]}}}, "nodes.checklist: room_low: "),
        ({"nodes": [1]}, "nodes: node: {name: value} expected, got [1]"),
    ],
)
def test_a_mistake_is_refused_in_one_line(tmp_path, changes, said):
    assert said in refusal(written(tmp_path, **changes))


def test_a_joint_that_the_vehicle_has_not_is_refused(tmp_path):
    servos = yaml.safe_load(template())["arm"]["servos"]
    servos[1]["joint"] = "elbow"
    text = refusal(written(tmp_path, arm__servos=servos))
    assert "arm.servos: joints alpha_1, elbow; the vehicle has alpha_1, alpha_2" in text


def test_a_profile_that_drives_the_servos_otherwise_is_refused(tmp_path):
    (tmp_path / "goals.yaml").write_text(
        "arm_controller: {ros__parameters: {setpoint: position}}\n"
    )
    text = refusal(written(tmp_path, profile=["s500", "goals.yaml"]))
    assert "drives the servos by position, the vehicle's are current" in text


def test_files_beside_the_lab_file_are_found_from_everywhere(tmp_path):
    nominal = configuration.path("mocap/motive_z_up.yaml").read_text()
    (tmp_path / "measured.yaml").write_text(nominal)
    arm = yaml.safe_load(template())["arm"] | {"device": "/dev/arm"}
    (tmp_path / "arm.yaml").write_text(yaml.safe_dump({"arm": arm}))
    file = written(tmp_path, mocap__calibration="measured.yaml", arm="arm.yaml")
    lab = load_lab(file)
    assert lab.mocap.calibration == str(tmp_path / "measured.yaml")
    assert lab.arm.device == "/dev/arm" and lab.arm_file == tmp_path / "arm.yaml"


def test_other_drivers_may_publish_the_poses_and_the_imu(tmp_path):
    lab = load_lab(written(tmp_path, mocap="topic", imu="topic"))
    assert lab.mocap is None and settings_of(lab).imu == "topic"


def test_the_magnet_of_the_autopilot(tmp_path):
    lab = load_lab(written(tmp_path, magnet=GRIPPER | {"magnet_at_exit": "hold"}))
    assert (lab.magnet.output.magnet, lab.magnet.output.magnet_output) == ("gripper", 2)
    assert lab.magnet.switching.magnet_at_exit == "hold"


@given(
    st.dictionaries(
        st.sampled_from([*REQUIRED, "nodes", "out", "profile", "cockpit"]),
        st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.lists(st.integers()),
        min_size=1,
        max_size=3,
    )
)
def test_nonsense_is_refused_in_one_line_or_read(tmp_path_factory, changes):
    file = tmp_path_factory.mktemp("lab") / "my_lab.yaml"
    file.write_text(yaml.safe_dump(yaml.safe_load(template()) | changes))
    try:
        load_lab(file)
    except LabError as error:
        assert "\n" not in str(error)


# --- other arms than that of the template ------------------------------------------------------


def arm_of(folder: Path, *servos: dict, **changes: Any) -> Path:
    """A lab file with servos like the template's first one, each with its changes."""
    first = yaml.safe_load(template())["arm"]["servos"][0]
    return written(folder, arm__servos=[first | one for one in servos], **changes)


def test_a_servo_of_another_current_unit_needs_its_own_constants(tmp_path):
    small = [{"model": "xl330_m288", "joint": f"alpha_{i}", "id": i} for i in (1, 2)]
    said = refusal(arm_of(tmp_path, *small))
    assert "model: xl330_m288 counts 1 mA, current_unit is 2.69 mA" in said
    own = {"current_unit": 0.001, "torque_per_current": 0.36, "current_limit": 1.4}
    lab = load_lab(arm_of(tmp_path, *(one | own for one in small)))
    assert [one.current_limit_counts for one in lab.arm.servos] == [1400, 1400]
    assert lab.arm.servos[0].torque_constant == pytest.approx(0.36)


@pytest.mark.parametrize(
    ("vehicle", "ids", "baud_rate"),
    [
        ("s500_arm", (7, 11), 57600),
        ("s500_arm3", (200, 3, 41), 4000000),
        ("s500_arm", (0, 252), 2000000),
    ],
)
def test_other_ids_baud_rates_and_three_joints_are_driven(tmp_path, vehicle, ids, baud_rate):
    """The lab file's arm on an emulated line: other ids and rates than those of the template."""
    servos = [{"joint": f"alpha_{i + 1}", "id": one} for i, one in enumerate(ids)]
    changes = {"vehicle": vehicle, "profile": vehicle.removesuffix("_arm")}
    lab = load_lab(arm_of(tmp_path, *servos, arm__baud_rate=baud_rate, **changes))
    assert lab.arm.ids == ids and lab.arm.baud_rate == baud_rate
    stowed = lab.vehicle.stowed
    made = [
        EmulatedServo(servo.id, StillShaft(angle), baud_rate=baud_rate)
        for servo, angle in zip(lab.arm.servos, stowed, strict=True)
    ]
    line = ServoLine(made)
    driver = ArmDriver(lab.arm, ArmDriverParameters(), port=LinePort(line))
    driver.start()
    assert driver.cycle().position == pytest.approx(stowed, abs=0.01)
    made[-1].connected = False  # the last one's cable
    for _ in range(10):
        assert driver.cycle() is None
    assert driver.health[-1].lost and not driver.health[0].lost
    driver.stop()
    others = ServoLine([EmulatedServo(1, StillShaft(0.0), baud_rate=1000000)])
    with pytest.raises(ArmError, match=f"id {ids[0]}.*no answer at {baud_rate} baud"):
        ArmDriver(lab.arm, ArmDriverParameters(), port=LinePort(others)).start()
