"""The law of a flight: --controller selects it, and the profile must have the same law."""

import pytest

from uam_control.settings import configuration
from uam_lab.flights.flight_settings import SettingsError, settings
from uam_sim_bridge.ports import PortError
from uam_sim_bridge.px4.px4_installation import Px4Error


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


@pytest.fixture
def px4_build(tmp_path):
    """A directory with the files of a PX4 build."""
    for file in ("bin/px4", "etc/init.d-posix/rcS"):
        (tmp_path / file).parent.mkdir(parents=True)
        (tmp_path / file).touch(0o755)
    (tmp_path / "parameters.json").write_text(
        '{"parameters": [{"name": "COM_OF_LOSS_T", "type": "Float", "min": 0, "max": 60}]}'
    )
    return str(tmp_path)


def test_parameters_of_px4_are_checked_before_the_flight(px4_build):
    px4 = {"autopilot": "px4", "px4_dir": px4_build}
    chosen = settings(**px4, px4_params=["COM_OF_LOSS_T=0.7"])
    assert chosen.px4_params == ("COM_OF_LOSS_T=0.7",)
    for text, why in (("COM_OF_LOSS_T=61", "0 to 60"), ("COM_OF_LOST_T=1", "none of this name")):
        with pytest.raises(Px4Error, match=why):
            settings(**px4, px4_params=[text])
    for autopilot in ("builtin", "udp:127.0.0.1:14580"):
        with pytest.raises(SettingsError, match="--px4-param needs --autopilot px4"):
            settings(autopilot=autopilot, px4_params=["COM_OF_LOSS_T=0.7"])


def test_a_signing_key_for_px4_is_refused(px4_build):
    key = {"mavlink_bridge": {"signing_key": "0f" * 32}}
    with pytest.raises(SettingsError, match="PX4 v1.16 and v1.17 have no MAVLink") as error:
        settings(autopilot="px4", px4_dir=px4_build, parameters=key)
    assert "0f" * 32 not in str(error.value)


def test_torque_setpoints_for_px4_are_refused(px4_build):
    wrench = {"profile": ["s500", "wrench_setpoints"]}
    with pytest.raises(SettingsError, match="PX4 v1.16 and v1.17 take no torque over MAVLink"):
        settings(autopilot="px4", px4_dir=px4_build, **wrench)
    assert settings(**wrench).autopilot == "builtin"


def test_px4_needs_ticks_that_it_answers(px4_build, tmp_path):
    ours = configuration.path("vehicle/s500_arm.yaml")
    text = ours.read_text().replace("control_period: 0.004", "control_period: 0.002")
    file = tmp_path / "quick.yaml"
    file.write_text(text.replace("model: ", f"model: {ours.parent}/"))
    assert settings(vehicle=file).vehicle.control_period == 0.002
    with pytest.raises(SettingsError, match="every 4 ms: control_period of quick is 2 ms"):
        settings(vehicle=file, autopilot="px4", px4_dir=px4_build)


def test_another_address_of_the_simulator_needs_an_autopilot_of_the_user(px4_build):
    away = {"sim_address": "0.0.0.0"}
    assert settings(autopilot="udp:192.0.2.7:14580", **away).sim_address == "0.0.0.0"
    for own in ({}, {"autopilot": "px4", "px4_dir": px4_build}):
        with pytest.raises(SettingsError, match="--sim-address needs an autopilot that you start"):
            settings(**own, **away)
    with pytest.raises(PortError, match="an IPv4 address expected"):
        settings(sim_address="here")
