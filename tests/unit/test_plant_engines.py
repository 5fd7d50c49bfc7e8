"""Which class flies as the plant, and what is refused."""

import pytest
from rigid_body_plant import RigidBodyPlant

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.engines import DEFAULT_PLANT, PlantError, plant_class
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

PLANT = "rigid_body_plant:RigidBodyPlant"


def test_a_plant_is_named_or_given_as_a_class():
    assert plant_class(DEFAULT_PLANT) is MujocoPlant
    assert plant_class(PLANT).__name__ == "RigidBodyPlant"


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("bullet", "unknown plant 'bullet'; there are: mujoco, or a class as module:Class"),
        ("no_such_module:Plant", "plant 'no_such_module:Plant': No module named 'no_such_module'"),
        ("uam_sim_bridge.plant:Nothing", "has no attribute 'Nothing'"),
        ("uam_sim_bridge.plant:Vehicle", "a class that is a Plant with all its methods expected"),
        ("uam_sim_bridge.plant:Plant", "a class that is a Plant with all its methods expected"),
    ],
)
def test_what_is_no_plant_is_refused_in_one_line(name, why):
    with pytest.raises(PlantError, match="^[^\n]*$") as refusal:
        plant_class(name)
    assert why in str(refusal.value)


def test_a_plant_that_does_not_count_its_ticks_ends_the_flight(monkeypatch):
    monkeypatch.setattr(RigidBodyPlant, "step", lambda self, *inputs: None)
    flight = DirectFlight(
        load_scenario("hover"), load_profile("s500"), Vehicle.load(), 0.0, 1, plant=PLANT
    )
    flight.run()
    assert flight.ended_by.endswith("RigidBodyPlant.step() does not add 1 to `tick`")
