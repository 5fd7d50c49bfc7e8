"""Template environment of the HTML pages, and pictures as data URIs."""

from __future__ import annotations

import base64
from pathlib import Path

import jinja2

MEDIA = {".png": "image/png", ".mp4": "video/mp4"}


def template(package: str, name: str) -> jinja2.Template:
    """Return a template from the folder of `package`; unknown variables raise an error."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package, "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(name)


def embedded(file: Path) -> str:
    """Return a picture or a video as a data URI."""
    return f"data:{MEDIA[file.suffix]};base64,{base64.b64encode(file.read_bytes()).decode()}"
