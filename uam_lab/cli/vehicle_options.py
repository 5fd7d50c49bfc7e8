"""The options --vehicle, --scenario and --profile, the same in several subcommands."""

from __future__ import annotations

import argparse

from uam_control.laws import catalogue
from uam_control.profiles.profile import Profile, default_profile, load_profile
from uam_control.settings import configuration
from uam_control.vehicle import DEFAULT_VEHICLE, VehicleDescription


def add_vehicle(parser: argparse.ArgumentParser) -> None:
    """Add --vehicle."""
    vehicles = ", ".join(configuration.names("vehicle", (".yaml",)))
    parser.add_argument(
        "--vehicle",
        default=DEFAULT_VEHICLE,
        metavar="NAME|FILE",
        help=f"{vehicles}, or the description of one: docs/your_vehicle.md (default %(default)s)",
    )


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """Add --scenario."""
    scenarios = ", ".join(configuration.names("scenarios"))
    parser.add_argument(
        "--scenario",
        default="pick_and_place",
        metavar="NAME|FILE",
        help=f"{scenarios}, or a .yaml or .csv file (default %(default)s)",
    )


def add_profile(parser: argparse.ArgumentParser) -> None:
    """Add --profile, for `given_profile`."""
    parser.add_argument("--profile", metavar="NAME|FILE", help="(default: the vehicle's)")


def given_profile(name_or_file: str | None, vehicle: VehicleDescription) -> Profile:
    """Return the profile of --profile; None: the vehicle's for the default law.

    Raises ConfigurationError, ProfileError.
    """
    if name_or_file is None:
        return default_profile(catalogue.DEFAULT, vehicle)
    return load_profile(str(configuration.named("profiles", name_or_file)), vehicle=vehicle)
