"""benchmarks/layouts.py: values against their targets."""

import pytest
from layout_targets.targets import CORES, MISSED, P50, PACE, Value, table

from uam_lab.experiments.budget.flown import LAYOUTS


@pytest.mark.parametrize(
    ("layout", "quantity", "value", "reached"),
    [
        ("separate", PACE, 1.5, True),
        ("separate", PACE, 1.49, False),
        ("fused", PACE, 2.9, False),
        ("fused", P50, 1.5, True),
        ("fused", MISSED, 0.06, False),
        ("separate", MISSED, 0.3, True),
        ("separate", CORES, 9.0, True),  # no target
    ],
)
def test_a_value_is_compared_in_its_direction(layout, quantity, value, reached):
    assert Value(layout, quantity, value).reached is reached


def test_the_table_shows_value_and_target():
    text = table([Value("fused", PACE, 2.5), Value("separate", "report with video [s]", 38.0)])
    assert "| fused | lockstep, simulated / wall time | 2.5 | at least 3 | **missed** |" in text
    assert "| separate | report with video [s] | 38 | - |  |" in text


def test_every_layout_has_targets():
    assert set(LAYOUTS) <= {"separate", "fused"}
