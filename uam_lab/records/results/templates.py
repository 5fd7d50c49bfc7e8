"""HTML pages from templates, pictures as data URIs, Markdown tables and their numbers."""

import base64
import math
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from uam_control.settings.texts import visible

SHARED = "uam_lab.records.results"  # package of templates that others extend
MEDIA = {".png": "image/png", ".mp4": "video/mp4"}


def render(package: str, name: str, **values: Any) -> str:
    """Return the page of a template from the folder of `package`; a missing value is an error.

    The template may extend results.html.j2, the page of an experiment's results.
    """
    return _template(package, name).render(values)


@cache
def _template(package: str, name: str) -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(one, ".") for one in (package, SHARED)]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(name)


def embedded(file: Path) -> str:
    """Return a picture or a video as a data URI."""
    return f"data:{MEDIA[file.suffix]};base64,{base64.b64encode(file.read_bytes()).decode()}"


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, without a newline at its end; a pipe in a cell is escaped."""
    lines = [f"| {' | '.join(map(_cell, cells))} |" for cells in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def _cell(text: str) -> str:
    return visible(text).replace("|", "\\|")


def shown(value: float | None, digits: int, without: str = "-") -> str:
    """Return a number with so many digits; `without` for None, NaN and infinity."""
    known = value is not None and math.isfinite(value)
    return f"{value:.{digits}f}" if known else without
