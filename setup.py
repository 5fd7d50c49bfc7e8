"""Used by colcon only (`colcon build` in a ROS workspace); pip reads pyproject.toml.

The console scripts and the packages are read from pyproject.toml, so nothing is listed twice.
"""

import os
import tomllib
from pathlib import Path

from setuptools import Distribution, find_packages, setup

ROOT = Path(__file__).resolve().parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


class ColconDistribution(Distribution):
    """Keeps setuptools away from pyproject.toml.

    colcon runs `setup.py` with its own idea of the metadata and fails on the specifier object
    that setuptools makes of `requires-python`.
    """

    def parse_config_files(
        self, filenames: list[str] | None = None, ignore_option_errors: bool = False
    ) -> None:
        names = filenames if filenames is not None else self.find_config_files()
        super().parse_config_files(
            [name for name in names if os.path.basename(name) != "pyproject.toml"],
            ignore_option_errors,
        )


def shared_data() -> list[tuple[str, list[str]]]:
    """(directory under the install prefix, files) for every shared-data entry of the wheel."""
    entries = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
    found: dict[str, list[str]] = {}
    for source, target in entries.items():
        for path in [ROOT / source] if (ROOT / source).is_file() else (ROOT / source).rglob("*"):
            if not path.is_file():
                continue
            relative = path.relative_to(ROOT / source)
            place = Path(target).parent if path == ROOT / source else (target / relative).parent
            found.setdefault(str(place), []).append(str(path.relative_to(ROOT)))
    return sorted(found.items())


setup(
    distclass=ColconDistribution,
    name=PROJECT["project"]["name"],
    version=PROJECT["project"]["version"],
    packages=find_packages(include=["uam_*"]),
    package_data={"": ["**/*"]},
    exclude_package_data={"": ["*.pyc"]},
    data_files=shared_data(),
    # colcon downloads nothing; `uam doctor` compares what is there with this list
    install_requires=PROJECT["project"]["dependencies"],
    # by this `colcon test` selects pytest
    extras_require={"test": PROJECT["project"]["optional-dependencies"]["test"]},
    entry_points={
        "console_scripts": [f"{k} = {v}" for k, v in PROJECT["project"]["scripts"].items()]
    },
)
