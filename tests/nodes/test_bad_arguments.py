"""Bad ROS arguments of the nodes that `run` does not start: one line and exit status 2."""

from pathlib import Path

import pytest

MODULES = (
    "uam_lab.records.recorder",
    "uam_lab.cockpit.cockpit_node",
    "uam_lab.preflight.checklist_node",
    *(f"uam_sim_bridge.nodes.{name}" for name in ("laboratory", "mujoco_sim")),
)


@pytest.fixture
def tagged(tmp_path, monkeypatch):
    """A parameter file of which ROS ignores what it does not know."""
    monkeypatch.chdir(tmp_path)
    Path("tagged.yaml").write_text("x: {ros__parameters: {a: !unknown 1}}")


@pytest.mark.parametrize("module", MODULES)
@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--params-file", "no_such_file.yaml"], "no_such_file.yaml"),
        (["-r", "__ns:=/1bad"], "/1bad"),
        (["-r", "__ns:=/uav1", "--params-file", "tagged.yaml"], "tagged.yaml"),
    ],
    ids=["no file", "bad namespace", "unknown tag"],
)
def test_bad_arguments_are_refused_in_one_line(start, tagged, module, arguments, complaint):
    node = start(module, "--ros-args", *arguments)
    assert node.process.wait(20) == 2, node.output
    name = module.rpartition(".")[2].removesuffix("_node")
    (line,) = [line for line in node.output.splitlines() if line.startswith(f"{name}: ")]
    assert complaint in line and "Traceback" not in node.output
