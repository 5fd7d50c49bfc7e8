"""Trials that recorded nothing, nodes that failed, and seeds that do not fit."""

import argparse
import math
import re
from dataclasses import fields

import pytest
import yaml
from adapting import flights
from adapting.flights import StudyFlight
from default_columns import COLUMNS
from hypothesis import given
from hypothesis import strategies as st

from uam_control.profiles.profile import load_profile
from uam_lab.cli.command import seed
from uam_lab.experiments.campaign.variations import Draws, VariationError, ranges
from uam_lab.experiments.trials import trial
from uam_lab.experiments.trials.trial import Trial, TrialFailed
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.flight_options import LAST_SEED
from uam_lab.flights.flight_settings import SettingsError, settings
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.timeseries import FlightTable

PROFILE, RANGES = load_profile("s500"), ranges()


def measures(flown):
    """What a campaign and a study do with a trial."""
    of_study = StudyFlight(
        **{one.name: getattr(flown, one.name) for one in fields(flown)}, condition="c"
    )
    return (lambda: trial.measure(flown)), (lambda: flights.measure(of_study))


def test_a_flight_that_ends_before_its_first_row_is_refused_in_one_line(monkeypatch):
    def ended(flight):
        flight.ended_by = "the physics is unstable"
        return flight.recording

    monkeypatch.setattr(DirectFlight, "run", ended)
    flown = Trial("row", PROFILE, 0.2, 3, "hover")
    assert trial.fly(flown).series is None
    for measure in measures(flown):
        with pytest.raises(TrialFailed, match="row, 0.2 kg, seed 3: the physics is unstable"):
            measure()


@pytest.mark.parametrize("rows", [0, 1])
def test_a_failed_node_is_no_result_of_the_law(monkeypatch, rows):
    recording = FlightTable(1, COLUMNS)
    for _ in range(rows):
        recording.next_row("waiting")[COLUMNS["time"]] = 0.0
    series = recording.series() if rows else None
    failed = Outcome(series, failure="estimator was killed")
    monkeypatch.setattr(trial, "_fly_nodes", lambda *_: failed)
    for measure in measures(Trial("row", PROFILE, 0.2, 3, "hover", engine="ros")):
        with pytest.raises(TrialFailed, match="estimator was killed"):
            measure()


@given(st.integers(0, 10**12))
def test_a_seed_is_read_if_the_settings_allow_it(number):
    if number <= LAST_SEED:
        assert seed(str(number)) == number
        return
    with pytest.raises(argparse.ArgumentTypeError, match="a whole number from 0 to 2147483647"):
        seed(str(number))
    with pytest.raises(SettingsError, match="2147483647"):
        settings(scenario="hover", seed=number)


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        ({"wind": [5.0, 0.0]}, "wind: [least, largest] expected, 0 or more: [5, 0]"),
        ({"wind": [0.0, math.nan]}, "wind: nan is not finite"),
        ({"mass": [-0.1, 1.0]}, "mass: [least, largest] expected, above 0: [-0.1, 1]"),
        ({"mass": [0.0, 1.0]}, "mass: [least, largest] expected, above 0: [0, 1]"),
        ({"mass": 1.0}, "mass: a list of 2 numbers expected: 1.0"),
    ],
)
def test_impossible_ranges_are_refused_in_one_line(tmp_path, entry, complaint):
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump({k: list(v) for k, v in RANGES.items()} | entry))
    with pytest.raises(VariationError, match=re.escape(f"{file}: {complaint}")):
        ranges(file)


@given(st.integers(0, 10**5), st.integers(1, 10**6))
def test_every_seed_of_a_campaign_fits_or_it_is_refused(chosen, total):
    try:
        drawn = Draws(PROFILE, total, chosen, RANGES)
    except VariationError as refusal:
        most = int(str(refusal).split(" to ")[1].split()[0])
        assert chosen > most
        drawn = Draws(PROFILE, total, most, RANGES)
    assert drawn[total - 1].seed <= LAST_SEED
