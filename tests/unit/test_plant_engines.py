"""Which class flies as the plant, and what is refused."""

import pytest

from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.plant import DEFAULT_PLANT, PlantError, plant_class


def test_a_plant_is_named_or_given_as_a_class():
    assert plant_class(DEFAULT_PLANT) is MujocoPlant
    assert plant_class("rigid_body_plant:RigidBodyPlant").__name__ == "RigidBodyPlant"


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
