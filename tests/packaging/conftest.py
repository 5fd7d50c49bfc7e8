"""A colcon workspace with a copy of this project in src/, built in both ways."""

import importlib.util
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from longer import longer

ROOT = Path(__file__).resolve().parents[2]
NOT_SOURCES = {".git", ".venv", "results", "build", "install", "log"}  # of the top folder
NOWHERE = "http://127.0.0.1:9"  # where a build that wants to download would have to ask
PATIENCE = 300.0  # [s] for a build; only a failing test waits that long


@dataclass(frozen=True)
class Workspace:
    """A workspace after `colcon build`: its folder and what `. install/setup.sh` makes of the
    environment."""

    folder: Path
    environment: dict[str, str]
    linked: bool  # with --symlink-install

    @property
    def prefix(self) -> Path:
        """Where the project is installed."""
        return self.folder / "install" / "uam"

    def python(self, program: str) -> str:
        """Output of a Python program that runs after sourcing."""
        command = [sys.executable, "-c", program]
        done = subprocess.run(
            command,
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()


@pytest.fixture(scope="session", params=["plain", longer("symlink")])
def workspace(request, tmp_path_factory) -> Workspace:
    """Built without any network."""
    if importlib.util.find_spec("colcon") is None:
        pytest.skip("colcon is not installed: it comes with the test extra, or from apt")
    folder = tmp_path_factory.mktemp(request.param)
    caches = shutil.ignore_patterns("__pycache__", ".*_cache")

    def ignored(place: str, names: list[str]) -> set[str]:
        return caches(place, names) | (NOT_SOURCES if Path(place) == ROOT else set())

    shutil.copytree(ROOT, folder / "src" / "uam", ignore=ignored)
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    offline = {"http_proxy": NOWHERE, "https_proxy": NOWHERE, "PIP_NO_INDEX": "1"}
    options = ["--symlink-install"] if request.param == "symlink" else []
    built = subprocess.run(
        [sys.executable, "-m", "colcon", "build", *options],
        cwd=folder,
        env=clean | offline,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    sourced = subprocess.run(
        ["sh", "-c", ". install/setup.sh && env -0"],
        cwd=folder,
        env=clean,
        capture_output=True,
        text=True,
        check=True,
    )
    pairs = (entry.partition("=") for entry in sourced.stdout.split("\0") if "=" in entry)
    environment = {name: value for name, _, value in pairs}
    return Workspace(folder, environment, linked=request.param == "symlink")
