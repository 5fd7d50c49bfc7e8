"""Whole flights through the command line, as a user starts them."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from whole_flight import SHORT, Flight

from uam_sim_bridge.ports import Reservation

HERE = Path(__file__).parent
# modules whose tests share a flight of their own
GROUPED = {"test_direct_flight", "test_fault_flights", "test_imu_stamps", "test_new_law"}


@pytest.fixture(scope="session")
def short_scenario(tmp_path_factory) -> Path:
    """A scenario file of a few seconds."""
    file = tmp_path_factory.mktemp("scenario") / "short.yaml"
    file.write_text(SHORT)
    return file


@pytest.fixture(scope="session")
def long_scenario(tmp_path_factory) -> Path:
    """As `short_scenario` with a minute of hovering: for a flight that the test cuts short."""
    file = tmp_path_factory.mktemp("scenario") / "long.yaml"
    file.write_text(SHORT.replace("from: 2,", "from: 62,").replace("at: 2,", "at: 62,"))
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


@dataclass(frozen=True)
class SharedFlights:
    """Flights with one seed that have ended, each with the same scenario.

    single: in a ROS domain of its own, with a report. uav1, uav2: two vehicles in one domain, each
    in its namespace; uav1 in the fused layout.
    """

    single: Flight
    uav1: Flight
    uav2: Flight
    domain: int  # of uav1 and uav2


@pytest.fixture(scope="session")
def shared_flights(tmp_path_factory, short_scenario):
    """Lockstep flights, flown at the same time."""
    folder = tmp_path_factory.mktemp("shared")
    options = ("--scenario", str(short_scenario), "--seed", "3")
    with Reservation() as reserved:
        domain = reserved.ports.domain
        vehicles = {
            name: (*options, "--domain", str(domain), "--namespace", name)
            for name in ("uav1", "uav2")
        }
        flights = {"single": Flight(folder / "single", *options, report=True)}
        vehicles["uav1"] += ("--fused",)
        flights |= {name: Flight(folder / name, *given) for name, given in vehicles.items()}
        try:
            statuses = {name: flight.wait() for name, flight in flights.items()}
        finally:
            for flight in flights.values():
                flight.end()
    for name, flight in flights.items():
        assert statuses[name] == 0, flight.said + flight.complained
    return SharedFlights(**flights, domain=domain)


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items):
    """Give tests that share flights one worker (--dist loadgroup); they are the first flights."""
    for item in items:
        if "shared_flights" in item.fixturenames:
            item.add_marker(pytest.mark.xdist_group("shared flights"))
        elif item.module.__name__.rpartition(".")[2] in GROUPED:
            item.add_marker(pytest.mark.xdist_group(item.module.__name__))
    ours = [item for item in items if item.path.is_relative_to(HERE)]
    others = [item for item in items if not item.path.is_relative_to(HERE)]
    items[:] = others + sorted(ours, key=lambda item: "shared_flights" not in item.fixturenames)
