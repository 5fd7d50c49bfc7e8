"""Whole flights through the command line, as a user starts them."""

from pathlib import Path

import pytest
from whole_flight import SHORT, Flight


@pytest.fixture(scope="session")
def short_scenario(tmp_path_factory) -> Path:
    """A scenario file of a few seconds."""
    file = tmp_path_factory.mktemp("scenario") / "short.yaml"
    file.write_text(SHORT)
    return file


@pytest.fixture
def fly(tmp_path):
    """fly(*options, report=False) starts a flight that ends with the test."""
    flights: list[Flight] = []

    def start(*options: str, report: bool = False) -> Flight:
        flights.append(Flight(tmp_path / f"flight_{len(flights)}", *options, report=report))
        return flights[-1]

    yield start
    for flight in flights:
        flight.end()


@pytest.fixture(scope="session")
def two_flights(tmp_path_factory, short_scenario):
    """Two lockstep flights with one seed, flown at the same time; both have ended.

    The first one has a report.
    """
    folder = tmp_path_factory.mktemp("twins")
    options = ("--scenario", str(short_scenario), "--seed", "3")
    flights = [Flight(folder / name, *options, report=name == "a") for name in ("a", "b")]
    statuses = [flight.wait() for flight in flights]
    for flight, status in zip(flights, statuses, strict=True):
        assert status == 0, flight.said + flight.complained
    yield flights
    for flight in flights:
        flight.end()
