"""Text on the terminal. Names and messages are shown as they are: never as markup or escape codes.

Everything that the commands print goes through `say`, or through a `Terminal` of rich.
"""

import sys
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from uam_control.settings.texts import visible


class Terminal(Console):
    """rich's console without markup: "[mm]" is a unit, "[/x]" a name. Styles are `Text` objects."""

    def __init__(self, **how: object) -> None:
        """how: see `rich.console.Console`."""
        super().__init__(**{"markup": False, "emoji": False, "highlight": False, **how})

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments, with control characters of their texts made visible."""
        for text, style, control in super().render(renderable, options):
            plain = text if control or text == "\n" else "\n".join(map(visible, text.split("\n")))
            yield Segment(plain, style, control)


def say(text: object = "", end: str = "\n", error: bool = False) -> None:
    """Print lines at once, with control characters made visible; error: to stderr."""
    lines = "\n".join(map(visible, str(text).split("\n")))
    print(lines, end=end, file=sys.stderr if error else sys.stdout, flush=True)
