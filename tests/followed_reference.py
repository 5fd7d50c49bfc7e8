"""A mission whose vehicle follows the reference exactly."""

from dataclasses import replace

import numpy as np

from uam_control.coordinates import ALPHA, CHI
from uam_control.mission import Mission, MissionParameters, load_scenario
from uam_control.supervision import Readings
from uam_control.vehicle import derived_parameters, load_description

VEHICLE = load_description()


def limits(vehicle):
    """Return the mission's parameters for a vehicle."""
    values = derived_parameters(vehicle)["mission"]
    return MissionParameters.from_mapping(values, len(vehicle.joints))


P = limits(VEHICLE)


def reference(x=0.0, y=0.0, z=1.0, yaw=0.0, arm=(0.0, 0.5), speed=(0.0, 0.0, 0.0)):
    made = np.zeros((3, ALPHA + len(arm)))
    made[CHI] = x, y, z, 0.0, 0.0, yaw, *arm
    made[1, :3] = speed
    return made


FRESH = Readings(mocap_age=0.0, joint_age=0.0, controller_age=0.0, autopilot_age=0.0)


class Flight:
    """A mission whose vehicle follows the reference exactly."""

    def __init__(self, scenario="pick_and_place", vehicle=VEHICLE, **parameters):
        self.limits = replace(limits(vehicle), **parameters)
        self.mission = Mission(load_scenario(scenario, vehicle), self.limits)
        self.state = reference(z=0.28, arm=vehicle.stowed)
        self.stamp, self.armed, self.references = 100.0, None, []
        self.step(1)
        assert self.mission.start() == (True, "arming")

    def step(self, ticks, dt=0.01):
        for _ in range(ticks):
            self.stamp += dt
            output = self.mission.step(self.stamp, self.state, self.armed, FRESH)
            self.armed = self.stamp if output.arm and self.armed is None else self.armed
            if output.flying:
                self.state = output.reference.copy()
                self.references.append(self.state)
        return self.mission.output

    def until(self, condition):
        for _ in range(20_000):
            if condition(self.step(1)):
                return
        raise AssertionError(f"still {self.mission.output}")

    def assert_smooth(self, dt=0.01):
        """All but roll and pitch, whose rates may have steps where the jerk has."""
        values = np.delete(np.array(self.references), [3, 4], axis=2)
        rates = (values[2:, 0] - values[:-2, 0]) / (2 * dt)
        np.testing.assert_allclose(rates, values[1:-1, 1], atol=4e-3)
        slopes = (values[2:, 1] - values[:-2, 1]) / (2 * dt)
        np.testing.assert_allclose(slopes, values[1:-1, 2], atol=0.12)
