"""docs/law.md names code that exists, and its equation numbers are those cited in the code."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/law.md").read_text()
PREFIXES = ("", "uam_control/", "uam_lab/analysis/")
CITED = re.compile(r"`((?:\w+/)*\w+\.py)(?:: (\w+))?`")


def names(file):
    tree = ast.parse(file.read_text())
    return {
        node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)
    }


@pytest.mark.parametrize(("path", "name"), sorted(set(CITED.findall(PAGE))))
def test_cited_code_exists(path, name):
    found = [ROOT / prefix / path for prefix in PREFIXES if (ROOT / prefix / path).is_file()]
    assert found, f"docs/law.md: no {path}"
    assert not name or name in names(found[0]), f"docs/law.md: no {name} in {path}"


def test_every_citation_of_a_printed_number_has_its_label():
    """Both stand together in the code, as "(12), rho_p", so that either one finds the line."""
    printed = dict(re.findall(r"\((\d+[a-d]?)\) `(\w+)`", PAGE))
    assert printed["12"] == "rho_p"
    assert printed["8a"] == "tau_p"
    assert printed["13"] == "adaptive_law_p"
