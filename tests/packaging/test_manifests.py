"""The manifests of the ROS packages name what their code imports, by keys of rosdep."""

import ast
import sys
import tomllib
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OWN = ("uam_control", "uam_msgs_py", "uam_sim_bridge", "uam_lab")
MANIFESTS = {name: ROOT / "ros/share" / name / "package.xml" for name in OWN}
# module → key in rosdep/python.yaml of ros/rosdistro; "-pip": not in apt
KEYS = {
    **{name: f"python3-{name}" for name in ("numpy", "scipy", "numba", "matplotlib", "jinja2")},
    **{name: f"python3-{name}" for name in ("lxml", "packaging", "psutil", "rich", "setproctitle")},
    **{name: f"python3-{name}-pip" for name in ("mujoco", "pymavlink")},
    "websockets": "python3-websockets",
    "mcap": "mcap-ros2-support",  # there is no key for mcap alone, which this one brings
    "serial": "python3-serial",
    "PIL": "python3-pil",
    "markupsafe": "python3-markupsafe",
    "yaml": "python3-yaml",
}
# rosdep has no key for these: docs/index.md installs them by pip
WITHOUT_KEY = {"dask", "distributed", "imageio_ffmpeg", "optuna", "pyarrow", "viser"}
# of the extra `hardware`, imported where a device is chosen; rosdep has no key for them either
WITHOUT_KEY |= {"gpiod", "motioncapture", "natnet"}
WITHOUT_KEY |= {"llvmlite"}  # numba brings it
# imported only where they are installed
OPTIONAL = {"pandas", "OpenGL", "ament_index_python", "dynamixel_sdk", "pyulog"}


def imported(package):
    """Modules from outside the standard library that the package imports."""
    found = set()
    for file in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                found |= {name.name.split(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names) - {package}


def depends(manifest, kind="exec_depend"):
    return [entry.text for entry in xml.parse(manifest).getroot().findall(kind)]


@pytest.mark.parametrize("package", OWN)
def test_a_manifest_has_exactly_the_dependencies_of_its_code(package):
    needed = imported(package) - OPTIONAL - WITHOUT_KEY
    assert sorted(depends(MANIFESTS[package])) == sorted(KEYS.get(name, name) for name in needed)


def test_two_packages_need_each_other_so_colcon_has_one():
    """Without this circle they could be colcon packages of their own."""
    assert "uam_msgs_py" in depends(MANIFESTS["uam_control"])
    assert "uam_control" in depends(MANIFESTS["uam_msgs_py"])
    assert [file.parent for file in ROOT.glob("*/package.xml")] == []


def test_the_manifest_of_the_workspace_package_has_them_all():
    """`rosdep install --from-paths` reads only this one: the others lie within its folder."""
    every = {key for manifest in MANIFESTS.values() for key in depends(manifest)}
    assert set(depends(ROOT / "package.xml")) == every - set(OWN)
    assert "python3-pytest" in depends(ROOT / "package.xml", "test_depend")


def test_citation_and_changes_have_the_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["version"] == PROJECT["version"] and cited["license"] == PROJECT["license"]
    assert f"\n## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text()


@pytest.mark.parametrize("manifest", [ROOT / "package.xml", *MANIFESTS.values()])
def test_version_maintainer_and_licence_are_those_of_the_project(manifest):
    top = xml.parse(manifest).getroot()
    assert top.findtext("version") == PROJECT["version"]
    assert top.findtext("license") == PROJECT["license"]
    (maintainer,) = top.findall("maintainer")
    assert maintainer.text and "@" in maintainer.get("email")
    assert top.find("export/build_type").text == "ament_python"
