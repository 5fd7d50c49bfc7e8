"""Stored results of an interrupted campaign."""

import numpy as np
import pytest

from uam_control.settings.configuration import ConfigurationError
from uam_lab.campaign.flown import FILE, Flown
from uam_lab.campaign.trial import TrialResult


def flight(seed):
    rms = np.linspace(0.1, np.pi, 8)
    rms[3] = np.nan
    return TrialResult(
        "random", 0.1, seed, rms, 2 * rms, 0.5, True, "lost", "fell", None, (0.1, 0.2), {"K0": 1.0}
    )


def test_flights_are_read_back_as_they_were(tmp_path):
    Flown(tmp_path, "x").add(flight(3))
    (read,) = Flown(tmp_path, "x").results.values()
    assert read.seed == 3 and read.lost and read.restless == (0.1, 0.2) and read.peaks == {"K0": 1}
    np.testing.assert_array_equal(read.rms, flight(3).rms)


def test_a_flight_whose_line_was_cut_is_flown_again(tmp_path):
    flown = Flown(tmp_path, "x")
    flown.add(flight(1))
    flown.add(flight(2))
    file = tmp_path / FILE
    file.write_text(file.read_text()[:-20])
    again = Flown(tmp_path, "x")
    assert list(again.results) == [1]
    again.add(flight(2))
    assert list(Flown(tmp_path, "x").results) == [1, 2]


def test_flights_of_something_else_are_not_mixed(tmp_path):
    Flown(tmp_path, "x").add(flight(1))
    with pytest.raises(ConfigurationError, match="give another --out"):
        Flown(tmp_path, "y")
