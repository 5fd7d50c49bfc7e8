"""Draws who may import whom, from the contracts in pyproject.toml, as docs/images/imports.svg.

    python docs/draw_imports.py

`make lint` checks the contracts against the code; a test checks the picture against the contracts.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs/images/imports.svg"
WIDTH, MARGIN, ROW, GAP, TITLE = 980, 24, 34, 8, 46  # all in pixels
COLOURS = ("#e8eef7", "#f8fafd", "#dbe6f4")  # package, folder, folder with an order inside


def layer_contracts() -> list[dict]:
    """The contracts of kind "layers"; the first one orders the packages."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contracts = document["tool"]["importlinter"]["contracts"]
    return [contract for contract in contracts if contract["type"] == "layers"]


def inner_layers(contracts: list[dict]) -> dict[str, list[list[str]]]:
    """Package → its layers, top first; a layer is a list of folders that import none of each
    other."""
    return {
        container: [layer.split(" | ") for layer in contract["layers"]]
        for contract in contracts
        for container in contract.get("containers", ())
    }


def first_line(package: str) -> str:
    """The first line of the docstring of a package."""
    source = (ROOT / package.replace(".", "/") / "__init__.py").read_text()
    return (ast.get_docstring(ast.parse(source)) or "").splitlines()[0].rstrip(".")


class Sheet:
    """Collects the elements of the picture, from top to bottom."""

    def __init__(self) -> None:
        self.elements: list[str] = []

    def box(self, x: float, y: float, width: float, height: float, colour: str) -> None:
        """A rounded box; lengths in pixels."""
        self.elements.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="6" '
            f'fill="{colour}" stroke="#8fa5c0"/>'
        )

    def text(self, x: float, y: float, words: str, style: str = "", anchor: str = "start") -> None:
        """A line of text with its baseline at y."""
        self.elements.append(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {style}>{escape(words)}</text>'
        )


def height_of(package: str, inner: dict[str, list[list[str]]], rows: list[list[str]]) -> float:
    """Height of a package's box with its rows of folders, in pixels."""
    heights = (
        max(folder_height(f"{package}.{folder}", inner) for folder in layer) for layer in rows
    )
    return TITLE + sum(height + GAP for height in heights)


def folder_height(folder: str, inner: dict[str, list[list[str]]]) -> float:
    """Height of a folder's box; more where an order inside it is drawn."""
    return ROW + len(inner.get(folder, ())) * (ROW + GAP)


def draw_rows(
    sheet: Sheet,
    package: str,
    rows: list[list[str]],
    inner: dict[str, list[list[str]]],
    x: float,
    y: float,
    width: float,
) -> None:
    """Draw the layers of a package, top first, from (x, y) on."""
    for layer in rows:
        height = max(folder_height(f"{package}.{folder}", inner) for folder in layer)
        room = (width - GAP * (len(layer) - 1)) / len(layer)
        for place, folder in enumerate(layer):
            left = x + place * (room + GAP)
            below = inner.get(f"{package}.{folder}", [])
            sheet.box(left, y, room, height, COLOURS[2] if below else COLOURS[1])
            sheet.text(left + room / 2, y + 22, folder, anchor="middle")
            draw_rows(sheet, f"{package}.{folder}", below, {}, left + 10, y + ROW, room - 20)
        y += height + GAP


def picture() -> str:
    """The whole picture as SVG."""
    packages, *others = layer_contracts()
    inner = inner_layers(others)
    alone = {"nodes", "profiles"}  # layers of uam_control that the first contract places itself
    sheet, y = Sheet(), MARGIN + 10.0
    sheet.text(
        MARGIN, y, "A folder imports from the folders below it only; side by side: not at all."
    )
    y += 16
    for layer in packages["layers"]:
        package, _, folder = layer.partition(".")
        rows = inner[package]
        if package == "uam_control":
            rows = [row for row in rows if (row == ["nodes"]) == (folder == "nodes")]
        height = height_of(package, inner, rows)
        sheet.box(MARGIN, y, WIDTH - 2 * MARGIN, height, COLOURS[0])
        named = layer if folder in alone - {"profiles"} else package
        sheet.text(MARGIN + 14, y + 20, named, 'font-weight="bold"')
        about = first_line(named)
        sheet.text(MARGIN + 14, y + 37, about, 'font-size="12" fill="#445"')
        draw_rows(sheet, package, rows, inner, MARGIN + 14, y + TITLE, WIDTH - 2 * MARGIN - 28)
        y += height + 14
    body = "\n".join(sheet.elements)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{y:.0f}" '
        f'font-family="sans-serif" font-size="14">\n'
        f'<rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    PICTURE.write_text(picture())
