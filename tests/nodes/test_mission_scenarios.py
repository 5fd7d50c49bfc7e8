"""The mission node: a scenario's options, and the check of its reference before take-off."""

from vehicle_rig import Vehicle


def made(start, probe, *parameters):
    words = [word for parameter in parameters for word in ("-p", parameter)]
    node = start("uam_control.nodes.mission", "--ros-args", *words)
    vehicle = Vehicle(probe)
    vehicle.node = node
    vehicle.fly(1)
    return vehicle


def test_a_reference_beyond_a_limit_is_in_the_pre_arm_report(start, probe):
    vehicle = made(start, probe, "scenario:=ellipse")
    accepted, answer = vehicle.ask("start")
    assert not accepted and "thrust 42.3 N exceeds 36 N at 22.7 s" in answer


def test_it_is_slowed_down_if_the_parameter_says_so(start, probe):
    vehicle = made(start, probe, "scenario:=ellipse", "retime:=true")
    accepted, answer = vehicle.ask("start")
    assert not accepted and "autopilot: unknown" in answer and "exceeds" not in answer
    assert "scenario ellipse: " in vehicle.node.output
    assert "times as slow" in vehicle.node.output
