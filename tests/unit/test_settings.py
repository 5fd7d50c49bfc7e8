"""The law of a flight: --controller selects it, and the profile must have the same law."""

import pytest

from uam_lab.flight.flight_settings import SettingsError, settings


@pytest.mark.parametrize(
    ("controller", "profile"), [("modular", "s500"), ("asmc1", "asmc1"), ("asmc2", "asmc2")]
)
def test_every_controller_has_its_default_profile(controller, profile):
    chosen = settings(controller=controller)
    assert chosen.profile.name == profile
    assert set(chosen.profile.laws().values()) == {controller}


@pytest.mark.parametrize(
    ("controller", "profile", "law"),
    [("modular", "asmc1", "asmc1"), ("asmc1", "asmc2", "asmc2"), ("asmc2", "s500", "modular")],
)
def test_a_profile_with_another_law_is_refused_in_one_line(controller, profile, law):
    with pytest.raises(SettingsError) as refused:
        settings(controller=controller, profile=profile)
    text = str(refused.value)
    assert f"profile {profile} has the law {law} for position_controller, not {controller}" in text
    assert "\n" not in text
