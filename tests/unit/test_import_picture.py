"""docs/images/imports.svg shows the import contracts of pyproject.toml as they are."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def drawing():
    spec = importlib.util.spec_from_file_location("draw_imports", ROOT / "docs/draw_imports.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_picture_is_that_of_the_contracts():
    draw = drawing()
    assert draw.PICTURE.read_text() == draw.picture(), "run: python docs/draw_imports.py"


def test_every_folder_of_a_contract_is_drawn():
    draw = drawing()
    _, *inner = draw.layer_contracts()
    folders = {name for rows in draw.inner_layers(inner).values() for row in rows for name in row}
    missing = {name for name in folders if f">{name}</text>" not in draw.picture()}
    assert folders
    assert not missing


def test_every_folder_exists():
    draw = drawing()
    _, *inner = draw.layer_contracts()
    for package, rows in draw.inner_layers(inner).items():
        place = ROOT / package.replace(".", "/")
        for name in (name for row in rows for name in row):
            assert (place / name).is_dir() or (place / f"{name}.py").is_file(), f"{package}.{name}"
