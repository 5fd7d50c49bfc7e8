"""What benchmarks/mutants.py mutates: every module of the maths that flies, each with its tests."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "benchmarks" / "mutating"
MODULES = tomllib.loads((DATA / "modules.toml").read_text())["modules"]
SURVIVORS = tomllib.loads((DATA / "survivors.toml").read_text())
FOLDERS = ("uam_control/laws", "uam_control/estimation")


def test_every_law_and_every_part_of_the_estimator_is_mutated():
    files = {
        str(file.relative_to(ROOT))
        for folder in FOLDERS
        for file in (ROOT / folder).glob("*.py")
        if file.name != "__init__.py"
    }
    assert files <= set(MODULES), "add them to benchmarks/mutating/modules.toml"


def test_modules_and_their_tests_exist():
    for path, tests in MODULES.items():
        assert (ROOT / path).is_file(), path
        assert tests, path
        for name in tests:
            assert (ROOT / "tests" / "unit" / f"{name}.py").is_file(), name


def test_every_listed_survivor_has_a_module_and_a_reason():
    assert set(SURVIVORS) <= set(MODULES)
    for entries in SURVIVORS.values():
        for one in entries:
            assert set(one) == {"line", "becomes", "reason"} and all(one.values())
