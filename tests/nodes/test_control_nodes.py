"""Each control node alone: start, report of missing inputs, parameters, clean stop."""

import signal

import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.parameter import Parameter

from uam_control.settings import configuration
from uam_msgs_py.messages import topics

INPUTS = {
    "position_controller": ["/uam/state", "/uam/reference"],
    "attitude_controller": ["/uam/state", "/uam/reference", "/uam/position/command"],
    "arm_controller": ["/uam/state", "/uam/reference", "/uam/position/command"],
    "state_estimator": ["/vrpn_mocap/uam/pose", "/joint_states", "/imu/data"],
    "mission": ["/uam/state"],
}


@pytest.mark.parametrize("name", INPUTS)
def test_alone_it_waits_and_stops(start, name):
    node = start(f"uam_control.nodes.{name}")
    node.until_logged("waiting for " + ", ".join(INPUTS[name]))
    assert node.interrupt(times=3) == 0
    assert "Traceback" not in node.output


def test_it_stops_on_sigterm(start):
    node = start("uam_control.nodes.state_estimator")
    node.until_logged("waiting for")
    assert node.interrupt(number=signal.SIGTERM) == 0


def test_diagnostics_name_missing_inputs(start, probe):
    diagnostics = probe.collect(topics.DIAGNOSTICS)
    start("uam_control.nodes.mission")
    probe.until(
        lambda: any("/uam/state" in m.status[0].message for m in diagnostics), "diagnostics"
    )
    status = diagnostics[-1].status[0]
    assert status.name == "mission"
    assert {"ticks", "messages refused"} <= {pair.key for pair in status.values}


@pytest.mark.parametrize(
    ("name", "arguments", "complaint"),
    [
        ("position_controller", ["-p", "varpi:=-1.0"], "varpi: -1.0 is outside"),
        (
            "position_controller",
            ["-p", "lamda_1:=[1.0, 1.0, 1.0]"],
            "did you mean lambda_1?",
        ),
        ("arm_controller", ["-p", "inertia:=[1.0, 1.0, 1.0]"], "a list of 2 numbers expected"),
        ("attitude_controller", ["-p", "inertia:=[1.0, .nan, 1.0]"], "inertia:"),
        ("arm_controller", ["-p", "law:=pid"], "law: 'pid' is not one of modular, asmc1, asmc2"),
        ("arm_controller", ["-p", "law:=asmc1", "-p", "varpi:=1.0"], "varpi: unknown; allowed: "),
        ("mission", ["-p", "scenario:=nowhere"], "nowhere"),
        ("mission", ["--params-file", "no_such_file.yaml"], "no_such_file.yaml"),
        ("state_estimator", ["-p", "position_bandwidth:=fast"], "'fast' is not numeric"),
        ("arm_controller", ["-p", "fifo_priority:=99"], "fifo_priority: 99 is outside 0 to 98"),
        ("arm_controller", ["-p", "cores:='1023'"], "cores: 1023; this process may use"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(start, name, arguments, complaint):
    node = start(f"uam_control.nodes.{name}", "--ros-args", *arguments)
    assert node.process.wait(60) == 2
    lines = [line for line in node.output.splitlines() if line.startswith(f"{name}: ")]
    assert len(lines) == 1 and complaint in lines[0]
    assert "Traceback" not in node.output


def test_a_malformed_parameter_file_is_refused(start, tmp_path):
    file = tmp_path / "broken.yaml"
    file.write_text("mission:\n  ros__parameters:\n    takeoff_delay: [1.0\n")
    node = start("uam_control.nodes.mission", "--ros-args", "--params-file", str(file))
    assert node.process.wait(60) == 2
    assert "broken.yaml" in node.output and "Traceback" not in node.output


def set_parameter(probe, node: str, name: str, value):
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return probe.call(SetParameters, f"/{node}/set_parameters", request).results[0]


def get_parameter(probe, node: str, name: str):
    request = GetParameters.Request(names=[name])
    return probe.call(GetParameters, f"/{node}/get_parameters", request).values[0]


def test_parameters_change_whole_or_not_at_all(start, probe):
    profile = configuration.path("profiles/s500.yaml")
    start("uam_control.nodes.attitude_controller", "--ros-args", "--params-file", str(profile))
    before = list(get_parameter(probe, "attitude_controller", "lambda_1").double_array_value)

    refused = set_parameter(probe, "attitude_controller", "lambda_1", [60.0, -60.0, 20.0])
    assert not refused.successful
    assert "lambda_1" in refused.reason and "outside" in refused.reason
    wrong_shape = set_parameter(probe, "attitude_controller", "lambda_1", [60.0, 60.0])
    assert "a list of 3 numbers expected" in wrong_shape.reason
    kept = get_parameter(probe, "attitude_controller", "lambda_1").double_array_value
    assert list(kept) == before

    changed = [value + 1.0 for value in before]
    assert set_parameter(probe, "attitude_controller", "lambda_1", changed).successful
    now = get_parameter(probe, "attitude_controller", "lambda_1").double_array_value
    assert list(now) == changed
    assert set_parameter(probe, "attitude_controller", "varpi", 1).successful  # an int is a number
    assert not set_parameter(probe, "attitude_controller", "control_period", 0.01).successful


@pytest.mark.parametrize("name", ["mission", "position_controller"])
def test_the_period_of_the_ticks_is_the_vehicles(start, probe, tmp_path, name):
    """At 8 ms no flight over ROS took off: each second tick counted as missed."""
    ours = configuration.path("vehicle/s500_arm.yaml")
    text = ours.read_text().replace("control_period: 0.004", "control_period: 0.008")
    file = tmp_path / "slow.yaml"
    file.write_text(text.replace("model: ", f"model: {ours.parent}/"))
    start(f"uam_control.nodes.{name}", "--ros-args", "-p", f"vehicle:={file}")
    assert get_parameter(probe, name, "control_period").double_value == 0.008


def test_every_parameter_has_meaning_unit_and_range(start, probe):
    start("uam_control.nodes.arm_controller")
    request = DescribeParameters.Request(names=["nu", "varpi", "lambda_form"])
    nu, varpi, form = probe.call(
        DescribeParameters, "/arm_controller/describe_parameters", request
    ).descriptors
    assert nu.description.endswith("[1/s]")
    assert nu.additional_constraints == "each 1e-06 to 10000 1/s"
    assert varpi.floating_point_range[0].to_value == pytest.approx(1e6)
    assert form.additional_constraints == "one of: theory, table, sliding"


def test_the_law_is_fixed_and_its_own_parameters_are_tunable(start, probe):
    profile = configuration.path("profiles/asmc2.yaml")
    start("uam_control.nodes.arm_controller", "--ros-args", "--params-file", str(profile))
    assert get_parameter(probe, "arm_controller", "law").string_value == "asmc2"
    refused = set_parameter(probe, "arm_controller", "law", "modular")
    assert not refused.successful
    assert "read-only" in refused.reason and "\n" not in refused.reason
    assert set_parameter(probe, "arm_controller", "kappa", [12.0, 12.0]).successful
    assert set_parameter(probe, "arm_controller", "adapt", False).successful
