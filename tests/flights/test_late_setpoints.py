"""A fast reference and late setpoints together: what is accepted is flown, the rest stays down."""

import pytest
from longer import longer

from uam_control.mission import ScenarioError
from uam_lab import Flight

# 45 degrees of tilt to and fro; see tests/unit/test_feasibility.py
ZIGZAG = """\
moves:
  - {{coordinate: z, from: 0, until: 2, to: 2}}
  - {{coordinate: x, from: 2, until: 4, to: {back}}}
  - {{coordinate: x, from: 4.5, until: 6.5, to: {way}}}
  - {{coordinate: x, from: 6.5, until: 8.5, to: {back}}}
  - {{coordinate: x, from: 9, until: 11, to: 0}}
landing: {{at: 11, duration: 3}}
"""


def flown(folder, way, delay, seed, begin="start", reserve=0.0):
    file = folder / "zigzag.yaml"
    file.write_text(ZIGZAG.format(way=way / 2, back=-way / 2))
    flight = Flight(
        scenario=str(file),
        engine="direct",
        seed=seed,
        out=folder / "out",
        faults=[f"mavlink_delay@{begin}:direction=to_autopilot,delay={delay}"],
        parameters={"mission": {"reference_delay": reserve}},
    )
    with flight:
        return flight.wait().metrics


@pytest.mark.parametrize("seed", [1, longer(3)])
def test_a_fast_zigzag_does_not_take_off_with_late_setpoints(tmp_path, seed):
    found = flown(tmp_path, 5.2, 0.028, seed)
    assert "that the reference stands" in found["abort_reason"]
    assert found["max"]["position_m"][2] is None  # nothing of a flight


def test_a_zigzag_that_stands_no_delay_that_may_begin_in_flight_is_refused(tmp_path):
    """With 40 ms from its middle on it turned over: the delay is known after seconds."""
    with pytest.raises(ScenarioError, match="change of the body rate 26.1 rad/s.2 exceeds 19.5"):
        flown(tmp_path, 5.2, 0.04, 1, begin=5.5, reserve=0.03)


def test_a_gentler_one_is_flown_with_them(tmp_path):
    found = flown(tmp_path, 3.0, 0.028, 1)
    assert found["mission_completed"]
    assert max(found["max"]["position_m"]) < 0.06
