"""Files are read and written as UTF-8, whatever the locale is; child processes' texts too."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(file for package in ROOT.glob("uam_*") for file in package.rglob("*.py"))


def unspecified(source):
    """Lines that open a text in the encoding of the locale."""
    for call in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)):
        name = getattr(call.func, "attr", getattr(call.func, "id", ""))
        given = {keyword.arg: keyword.value for keyword in call.keywords}
        words = [one.value for one in call.args if isinstance(getattr(one, "value", 0), str)]
        mode = next((word for word in words if len(word) < 4), "r")
        path = isinstance(call.func, ast.Attribute) and name in ("read_text", "write_text")
        opened = name == "open" and (words or isinstance(call.func, ast.Name)) or name == "fdopen"
        if (path or opened or "text" in given and name in ("run", "Popen")) and not (
            "encoding" in given or "b" in mode
        ):
            yield call


@pytest.mark.parametrize("package", sorted({file.relative_to(ROOT).parts[0] for file in SOURCES}))
def test_every_text_is_utf_8(package):
    found = [
        f"{file.relative_to(ROOT)}:{call.lineno}"
        for file in SOURCES
        if file.relative_to(ROOT).parts[0] == package
        for call in unspecified(file.read_text(encoding="utf-8"))
    ]
    assert not found


def test_the_check_finds_each_form():
    forms = ["p.read_text()", "p.write_text(x)", 'open(f, "w")', 'p.open("w", newline="")']
    forms += ["open(f)", 'os.fdopen(1, "w")', "subprocess.run(c, text=True)"]
    assert all(list(unspecified(form)) for form in forms)
    good = ['p.read_text(encoding="utf-8")', 'open(f, "rb")', 'p.open("xb")', "write_text(p, x)"]
    good += ["bus.open()", "os.open(f, flags, 0o600)"]
    assert not [form for form in good if list(unspecified(form))]
