"""Writes the table of effects into docs/plant.md: python docs/make_plant.py."""

from pathlib import Path

from uam_sim_bridge.plant.effects.presets import table

PAGE = Path(__file__).with_name("plant.md")
BEGIN, END = "<!-- table of effects: docs/make_plant.py -->\n", "<!-- end of the table -->\n"


def page(text: str) -> str:
    """Return the page with the table of the code."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
