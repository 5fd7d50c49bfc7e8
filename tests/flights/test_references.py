"""References of the library in the direct engine: their errors, and what is slowed down."""

import pytest

from uam_lab.flights.library.flight import Flight


def flown(tmp_path, **options):
    with Flight(engine="direct", out=tmp_path / "flight", **options) as flight:
        return flight.wait()


@pytest.mark.parametrize(
    ("name", "allowed"),  # 3-D RMSE in the phase `trajectory` [m]
    [
        ("lemniscate_payload", 0.024),
        pytest.param("lemniscate", 0.012, marks=pytest.mark.slow),
        pytest.param("race_5", 0.020, marks=pytest.mark.slow),
    ],
)
def test_a_reference_is_tracked(tmp_path, name, allowed):
    result = flown(tmp_path, scenario=name)
    assert result.completed, result.metrics["shortfalls"]
    assert result.metrics["trajectory"]["position_3d_m"] <= allowed


def test_a_circle_is_tracked_and_the_flight_lands_where_it_ends(tmp_path):
    result = flown(tmp_path, scenario="circle_fast", end="land")
    assert result.completed and result.metrics["landing_error_m"] < 0.05
    assert result.metrics["trajectory"]["position_3d_m"] <= 0.010
    assert result.outcome.series["truth.x"][-1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_an_impossible_ellipse_is_flown_slower(tmp_path):
    result = flown(tmp_path, scenario="ellipse", retime=True)
    assert result.completed, result.metrics["shortfalls"]
    assert result.metrics["trajectory"]["position_3d_m"] <= 0.05
    assert any(note.startswith("retimed: ") for note in result.outcome.notes)
