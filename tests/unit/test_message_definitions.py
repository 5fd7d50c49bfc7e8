"""The schemas of a log hold the .msg files of a type and of all that it contains."""

import pytest

from uam_lab.records.recording.bag import DefinitionMissing, schema

pytest.importorskip("rclpy")


def test_a_schema_holds_every_dependency_once():
    text = schema("sensor_msgs/msg/Imu")
    for name in ("std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"):
        assert text.count(f"MSG: {name}\n") == 1
    assert text.count("MSG: builtin_interfaces/Time\n") == 1
    assert "float64[9] orientation_covariance" in text


def test_a_type_of_primitives_alone_has_no_dependencies():
    assert "MSG: " not in schema("std_msgs/msg/Bool")
    assert schema("diagnostic_msgs/msg/DiagnosticStatus").count("MSG: ") == 1


def test_an_unknown_type_is_named():
    with pytest.raises(DefinitionMissing, match="no_such_msgs"):
        schema("no_such_msgs/msg/Thing")
    with pytest.raises(DefinitionMissing, match="std_msgs/msg/Thing"):
        schema("std_msgs/msg/Thing")
