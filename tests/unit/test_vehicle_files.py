"""Files of a vehicle: broken ones are refused by name, paths count from the vehicle's folder."""

from __future__ import annotations

import re
import shutil

import pytest

from uam_control.profiles.profile import default_profile
from uam_control.settings.configuration import ConfigurationError, path
from uam_control.vehicle import VehicleError, load_description
from uam_control.vehicle.loading import NOT_OF_THE_PLANT
from uam_lab.flights.flight_settings import settings
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

BROKEN = {  # what replaces a text of a part → what is said
    "mesh": ("hexa.xml", "<worldbody>", '<asset><mesh name="m" file="no.stl"/></asset><worldbody>'),
    "inertia": ("parts/hexa_frame.xml", 'diaginertia="', 'diaginertia="9 '),
    "include": ("hexa.xml", "parts/world.xml", "parts/wrld.xml"),
    "include of itself": ("hexa.xml", "parts/world.xml", "hexa.xml"),
    "no XML": ("hexa.xml", "</mujoco>", ""),
    "no number": ("parts/world.xml", 'axis="0 -1 0"', 'axis="0 one 0"'),
    "not finite": ("parts/world.xml", 'axis="0 -1 0"', 'axis="0 -1 NaN"'),
    "mass below 0": ("parts/arm_2r.xml", ' mass="', ' mass="-'),
    "part no XML": ("parts/world.xml", "</mujoco", "</mujo"),
    "no time step": ("hexa.xml", "<worldbody>", '<option timestep="0"/><worldbody>'),
    "another model": ("parts/arm_2r.xml", "alpha_1", "beta"),
    "a joint twice": (
        "hexa.xml",
        "</worldbody>",
        '<body><joint name="alpha_1"/></body></worldbody>',
    ),
    "a body twice": ("hexa.xml", "</worldbody>", '<body name="base"/></worldbody>'),
    "no base": ("hexa.xml", 'name="base"', 'name="bsae"'),
    "include of each other": (
        "parts/world.xml",
        "<worldbody>",
        '<include file="hexa.xml"/><worldbody>',
    ),
    "no picture": (
        "hexa.xml",
        "<worldbody>",
        '<asset><texture name="t" type="2d" file="no.png"/></asset><worldbody>',
    ),
    "no arm": ("hexa.xml", '<include file="parts/arm_2r.xml"/>', ""),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_mjcf_is_one_line_that_names_it(tmp_path, what):
    shutil.copytree(path("vehicle/parts"), tmp_path / "parts")
    model = path("vehicle/hexa_arm.xml").read_text()
    (tmp_path / "hexa.xml").write_text(model)
    text = path("vehicle/hexa_arm.yaml").read_text().replace("hexa_arm.xml", "hexa.xml")
    (tmp_path / "mine.yaml").write_text(text)
    name, plain, broken = BROKEN[what]
    file = tmp_path / name
    assert plain in file.read_text()
    file.write_text(file.read_text().replace(plain, broken))
    with pytest.raises(VehicleError) as refused:
        settings(engine="direct", scenario="hover", vehicle=tmp_path / "mine.yaml")
    assert "hexa.xml: " in str(refused.value) and "\n" not in str(refused.value)


def test_files_of_a_vehicle_are_found_beside_it(tmp_path, monkeypatch):
    mine = tmp_path / "there"
    shutil.copytree(path("vehicle/parts"), mine / "parts")
    shutil.copy(path("vehicle/hexa_arm.xml"), mine)
    shutil.copy(path("profiles/hexa.yaml"), mine / "gains.yaml")
    (mine / "rates.yaml").write_text(path("autopilot/hexa.yaml").read_text())
    text = path("vehicle/hexa_arm.yaml").read_text()
    text = re.sub("(?m)^profiles:.*", "profiles: {modular: gains.yaml}", text)
    text = re.sub("(?m)^autopilot:.*", "autopilot: ./rates.yaml", text)
    (mine / "mine.yaml").write_text(text)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    vehicle = load_description("../there/mine.yaml")
    assert vehicle.autopilot_gains == load_description("hexa_arm").autopilot_gains
    assert default_profile("modular", vehicle).file.samefile(mine / "gains.yaml")
    (mine / "mine.yaml").write_text(text.replace("./rates", "sub/none"))
    with pytest.raises(ConfigurationError, match="there/sub/none.yaml does not exist"):
        load_description("../there/mine.yaml")


class Noting(dict):
    """Entries of a vehicle that note which of them are read, by their dotted names."""

    def __init__(self, values, read, prefix=""):
        super().__init__(values)
        self.read, self.prefix = read, prefix

    def __getitem__(self, key):
        value, name = super().__getitem__(key), f"{self.prefix}{key}"
        if isinstance(value, dict):
            return Noting(value, self.read, f"{name}.")
        self.read.add(name)
        return value

    def get(self, key, default=None):
        return self[key] if key in self else default


def leaves(values, prefix=""):
    for key, value in values.items():
        if isinstance(value, dict) and value:
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}"


def test_a_change_that_is_accepted_is_read_by_the_plant():
    vehicle, read = Vehicle.load(), set()
    MujocoPlant(Vehicle(vehicle.description, Noting(vehicle.numbers, read)), 0.2, 1, disturbed=True)
    unread = {name for name in leaves(vehicle.description.numbers) if name not in read}
    assert not {name.removesuffix(".modular") for name in unread} - set(NOT_OF_THE_PLANT)
    assert not read & set(NOT_OF_THE_PLANT)
