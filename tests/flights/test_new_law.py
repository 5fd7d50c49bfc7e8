"""A law that is one file and one line flies, is recorded, and is in the report."""

import json
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest
from whole_flight import ROOT, SHORT

from uam_lab.records.results.timeseries import read

# what the line in uam_control/laws/catalogue.py does
WITH_PID = """\
import sys
sys.path.insert(0, "tests")
from pid_law import PidLaw
from uam_control.laws import catalogue
catalogue.LAWS["pid"] = PidLaw
"""
# a step that is not under @jit splits the loop of the flight: nothing is compiled for it
IN_PYTHON = "PidLaw.step = staticmethod(getattr(PidLaw.step, 'py_func', PidLaw.step))\n"
RUN = "from uam_lab.cli.main import main\nsys.exit(main())\n"


def chosen(place):
    """Options of the law, the file of its parameter and the scenario in a folder."""
    files = str(place / "part.yaml"), "--scenario", str(place / "short.yaml")
    return "--controller", "pid", "--profile", *files


def uam(*options, law=WITH_PID + IN_PYTHON):
    """Run `uam` with the law registered."""
    command = [sys.executable, "-c", law + RUN, *options]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=240)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The result folder of a short flight with it; a file changes one parameter of its defaults.

    The law has no profile whose name could stand before the file.
    """
    place = tmp_path_factory.mktemp("pid")
    (place / "short.yaml").write_text(SHORT)
    (place / "part.yaml").write_text("arm_controller: {ros__parameters: {kappa: [0.25, 0.25]}}")
    options = ("--engine", "direct", "--no-video", "--out", str(place / "out"))
    flown = uam("fly", *chosen(place), *options)
    assert flown.returncode == 0, flown.stdout + flown.stderr
    return place / "out"


def test_a_law_of_one_file_completes_a_flight(folder):
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["mission_completed"] and metrics["controller"] == "pid"
    assert max(metrics["rms"]["position_m"]) < 0.1


@pytest.mark.long  # the law and the loop of a flight are compiled for it: a minute
def test_its_compiled_step_flies_the_same(folder, tmp_path):
    options = ("--engine", "direct", "--no-report", "--out", str(tmp_path))
    flown = uam("fly", *chosen(folder.parent), *options, law=WITH_PID)
    assert flown.returncode == 0, flown.stdout + flown.stderr
    one, other = (read(place / "timeseries.parquet") for place in (folder, tmp_path))
    np.testing.assert_array_equal(one.values, other.values)


def test_its_gains_are_recorded_one_per_axis(folder):
    table = pq.read_table(folder / "timeseries.parquet")
    for subsystem, axes in (("position", 3), ("attitude", 3), ("arm", 2)):
        for i in (1, 2, 3):
            values = table[f"adaptation.{subsystem}.Z{i} [1]"].to_numpy()
            assert np.isfinite(values).any() == (i <= axes)


def test_the_parameters_flown_are_shared_ones_of_the_default_profile_its_own_and_the_files(folder):
    from uam_control.profiles.profile import load_profile
    from uam_control.settings.parameter_file import read_sections

    flown = read_sections(folder / "parameters.yaml")
    kappas = {"position_controller": [0.5] * 3, "arm_controller": [0.25] * 2}
    for node, kappa in kappas.items():
        shared = load_profile("s500").section(node)
        for name in ("inertia", "lambda_1", "lambda_2"):
            assert flown[node][name] == shared[name]
        assert flown[node]["kappa"] == kappa
        assert "varpi" not in flown[node]


def test_the_report_calls_it_by_its_label(folder):
    assert "PID" in (folder / "report.html").read_text()


def test_the_command_line_offers_it():
    assert "pid: PID" in uam("fly", "--help").stdout
    assert "pid" in uam("compare", "--help").stdout
