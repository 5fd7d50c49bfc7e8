"""Shares and percentiles of many flights, with their bands."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_lab.experiments.campaign.report import BINS, _with_band, percentile, share, sliced
from uam_lab.records.results.templates import render


def test_the_band_of_a_share_is_wilsons():
    # R. G. Newcombe, Statist. Med. 17 (1998) 857, table I, method 3: 81/263, 15/148, 0/20, 1/29
    for count, total, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert share(count, total) == pytest.approx((count / total, low, high), abs=1e-4)


@given(st.integers(1, 10**6).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_a_share_is_within_its_band(counted):
    middle, low, high = share(*counted)
    assert -1e-12 <= low <= middle <= high <= 1.0 + 1e-12 and low < high


def test_the_band_of_a_median_contains_the_true_one_in_19_of_20_samples():
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(400):
        _, low, high = percentile(random.exponential(size=200), 50.0)
        hits += low <= math.log(2.0) <= high
    assert 0.92 * 400 <= hits <= 0.99 * 400


def test_few_flights_give_no_end_of_the_band():
    middle, low, high = percentile(np.array([1.0, 2.0, np.nan, 3.0]), 99.0)
    assert middle == pytest.approx(2.98) and low <= middle and high == math.inf
    assert all(math.isnan(one) for one in percentile(np.array([np.nan]), 50.0))


def test_no_flight_with_errors_gives_no_percentile():
    assert _with_band(percentile(np.array([np.nan]), 50.0), 3, "m") == "unknown"


def test_the_page_says_how_many_flights_a_step_has():
    values = np.arange(45.0)
    slices = {"wind": sliced(values, values > 40.0, values)}  # two bins: 23 and 22
    lists = dict.fromkeys(("heads", "percentiles", "worst", "outcomes"), [])
    texts = dict.fromkeys(("vehicle", "sentence", "picture", "command"), "x")
    page = render(
        "uam_lab.experiments.campaign", "campaign.html.j2", slices=slices, **lists, **texts
    )
    assert "Each step is 22 or 23 of 45 flights." in page


def test_a_slice_shows_where_flights_fail():
    wind = np.linspace(0.0, 5.0, 1000)
    np.random.default_rng(1).shuffle(wind)
    error = 0.01 * (1.0 + wind)
    error[0] = np.nan
    bins = sliced(wind, wind > 4.0, error)
    assert len(bins) == BINS and sum(one.flights for one in bins) == 1000
    assert all(a.high < b.low for a, b in zip(bins, bins[1:], strict=False))
    assert [one.completed[0] for one in bins] == pytest.approx([1.0] * 8 + [0.0] * 2)
    middles = [one.error[1] for one in bins]
    assert middles == pytest.approx([0.01 * (1.25 + 0.5 * k) for k in range(BINS)], abs=2e-4)
    assert len(sliced(wind[:5], wind[:5] > 4.0, error[:5])) == 1
