"""Notes on a profile that is probably another vehicle's."""

from dataclasses import replace

import pytest

from uam_control.profiles.profile import default_profile, load_profile, profile_of
from uam_control.vehicle import chain_of, load_description
from uam_lab.flights import flight_settings
from uam_lab.flights.flight_settings import settings
from uam_lab.flights.node_options import unread

S500 = load_description()


@pytest.mark.parametrize("name", ["s500_arm", "s500_arm3", "hexa_arm"])
def test_the_vehicles_here_have_profiles_that_fit(name):
    assert not default_profile("modular", load_description(name)).misfits


@pytest.mark.parametrize(
    ("mass", "full", "expected"),
    [
        (1.7, 41.4, ""),  # 2.2 kg is 29 % more
        (3.1, 41.4, ""),  # and 29 % less
        (0.5, 41.4, "inertia 2.2 kg along x, the vehicle has 0.5 kg"),
        (6.0, 120.0, "inertia 2.2 kg along x, the vehicle has 6 kg"),
        (2.2, 28.0, "thrust_max 36 N, the rotors' full thrust is 28 N"),
    ],
)
def test_a_profile_of_another_vehicle_is_named(mass, full, expected):
    rotor = replace(
        S500.rotor, thrust_coefficient=full / len(S500.rotors) / S500.rotor.speed_max**2
    )
    vehicle = replace(S500, mass=mass, rotor=rotor)
    text = "; ".join(load_profile("s500", vehicle=vehicle).misfits)
    whole = f"profile s500 does not fit s500_arm: position_controller has {expected}"
    assert text == (whole if expected else "")


def test_a_bandwidth_that_the_rate_of_the_poses_caps_is_named():
    profile = default_profile("modular")
    sections = profile.sections | {"state_estimator": {"position_bandwidth": 45.0}}
    (text,) = profile_of(sections, profile.file).misfits  # 120 poses per second: 0.3 * 120
    assert text.endswith("position_bandwidth 45 rad/s acts as 36: a pose comes every 8.33 ms")


def test_the_flights_notes_have_it():
    made = settings("hover", engine="direct", profile="hexa")
    (note,) = made.notes
    assert "thrust_max 52 N, the rotors' full thrust is 41.4 N" in note


@pytest.mark.parametrize(("torque", "left"), [("0/0/-0.2", "about z, of 0.228"), ("0.8/0/0", "x")])
def test_a_plant_that_takes_most_of_the_torque_is_named(torque, left):
    """0.3 N m of yaw, of which the laboratory leaves 76 %: 0.228; and 1.5 N m of roll."""
    options = {"engine": "direct", "plant_preset": ["laboratory"]}
    assert not settings("hover", **options).notes
    (note,) = settings("hover", effects=[f"standing_load:torque={torque}"], **options).notes
    assert note.startswith("standing_load: 0.") and left in note


@pytest.mark.parametrize(
    ("scenario", "profile", "effect", "named"),
    [
        ("ellipse_yaw", ["s500"], "standing_load", True),
        ("hover", ["s500"], "standing_load", False),  # its heading is the same all the time
        ("ellipse_yaw", ["s500", "indoors"], "standing_load", False),
        ("ellipse_yaw", ["s500"], "standing_load:turning=0", False),
    ],
)
def test_a_force_that_turns_with_a_heading_with_which_theta_hat_does_not(
    scenario, profile, effect, named
):
    made = settings(scenario, engine="direct", profile=profile, effects=[effect])
    assert [note for note in made.notes if note.endswith("--profile s500 --profile indoors")] == [
        note for note in made.notes if note.startswith("standing_load: its force turns")
    ]
    assert named == any(note.startswith("standing_load: its force turns") for note in made.notes)


@pytest.mark.parametrize(("limit", "rate"), [(6.0, 0.8), (0.5, 0.36)])
def test_the_way_to_a_trajectory_turns_as_the_vehicle_can(limit, rate):
    """90 % of the bridge's limit is the reference's; 0.8 of it: 0.36 of 0.5 rad/s."""
    bridge = {"mavlink_bridge": {"rate_limit": [6.0, 6.0, limit]}}
    made = settings("hover", engine="direct", parameters=bridge)
    assert made.scenario_options.transit_yaw_rate == pytest.approx(rate)


def test_a_battery_that_is_small_for_the_vehicle_is_named():
    """5 A h are the S-500's: 2.2 A h is less than half; its resistance grows to 0.005 2.2 / 5."""
    options = {"engine": "direct", "plant_preset": ["laboratory"]}
    (note,) = settings("hover", effects=["battery_sag:capacity=2.2"], **options).notes
    assert "2.2 A h are few for 2.2 kg" in note
    assert note.endswith("--effect battery_sag:capacity=5,resistance=0.0022")


def test_a_flight_with_payload_says_that_there_is_no_end_effector(monkeypatch):
    none = chain_of(S500)._replace(has_hand=0)
    monkeypatch.setattr(flight_settings, "chain_of", lambda vehicle: none)
    note = "s500_arm.yaml has no end effector: nothing is steered to the payload"
    assert settings("quick_pick", engine="direct").notes == (note,)
    assert not settings("hover", engine="direct").notes
    assert not settings("quick_pick", engine="direct", payload_mass=0.0).notes


def test_the_section_arm_of_older_files_is_named(monkeypatch):
    older = replace(S500, numbers=S500.numbers | {"arm": {"links": [0.1, 0.14]}})
    monkeypatch.setattr(flight_settings, "load_description", lambda name: older)
    (note,) = settings("hover", engine="direct").notes
    assert note == "s500_arm.yaml: arm: not used, the lengths are those of s500_arm.xml"


def test_a_section_that_no_node_reads_is_named():
    profile = default_profile("modular", load_description())
    assert not unread(profile)
    typed = profile_of({**profile.sections, "misssion": {"geofence_land": 1.0}}, profile.file)
    (text,) = unread(typed)
    assert "no node of the flight reads misssion; it has: position_controller" in text
