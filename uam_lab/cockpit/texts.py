"""Texts on the page. All of them are escaped here, by a template, or by the browser's own labels.

viser's Markdown lets raw HTML through: the page has none.
"""

from collections.abc import Iterable

from markupsafe import Markup, escape

BOX = Markup('<div style="font-size:0.9em;line-height:1.45;padding:4px 8px">{}</div>')


def shown(lines: Iterable[str]) -> str:
    """Return the HTML of plain lines."""
    return str(BOX.format(Markup("<br>").join(escape(line) for line in lines)))
