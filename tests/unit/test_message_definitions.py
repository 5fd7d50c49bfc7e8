"""The schemas of a log hold the .msg files of a type and of all that it contains."""

import pytest

from uam_lab.records.recording.bag import DefinitionMissing, dependencies, schema

pytest.importorskip("rclpy")


def test_a_schema_holds_every_dependency_once():
    text = schema("sensor_msgs/msg/Imu")
    for name in ("std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"):
        assert text.count(f"MSG: {name}\n") == 1
    assert text.count("MSG: builtin_interfaces/Time\n") == 1
    assert "float64[9] orientation_covariance" in text


def test_constants_comments_and_primitives_are_no_dependencies():
    assert dependencies("std_msgs/msg/Bool") == []
    assert dependencies("diagnostic_msgs/msg/DiagnosticStatus") == ["diagnostic_msgs/msg/KeyValue"]
    assert dependencies("trajectory_msgs/msg/JointTrajectory") == [
        "std_msgs/msg/Header",
        "trajectory_msgs/msg/JointTrajectoryPoint",
    ]


def test_an_unknown_type_is_named():
    with pytest.raises(DefinitionMissing, match="no_such_msgs"):
        schema("no_such_msgs/msg/Thing")
    with pytest.raises(DefinitionMissing, match="std_msgs/msg/Thing"):
        schema("std_msgs/msg/Thing")
