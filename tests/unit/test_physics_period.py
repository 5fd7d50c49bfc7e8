"""A control period in one compiled call is the same as its physics steps one by one."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.maths.compiled import active
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_control.vehicle import load_description
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.physics import actuate, average, begin_period
from uam_sim_bridge.plant.plant import check_arrays

VEHICLES = {name: Vehicle.of(load_description(name)) for name in ("s500_arm3", "hexa_arm")}


def one_by_one(plant, motors, effort, magnet):
    """As `MujocoPlant.step`, with MuJoCo's own step."""
    arrays, steps = plant.body, plant.memory["steps"].item()
    begin_period(arrays, effort, magnet, np.zeros(3), plant.tick)
    for _ in range(steps):
        actuate(arrays, motors)
        mujoco.mj_step(plant.model, plant.data)
        average(arrays, 1.0 / steps)
    plant.tick += 1


@pytest.mark.parametrize("name", VEHICLES)
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_bit_for_bit(name, seed, magnet):
    one, other = (MujocoPlant(VEHICLES[name], 0.2, seed=1) for _ in range(2))
    drawn = np.random.default_rng(seed)
    for _ in range(20):
        motors = drawn.uniform(0.0, 1.0, len(one.rotors.speed))
        effort = drawn.uniform(-1.0, 1.0, one.joints)
        one.step(motors, effort, magnet)
        one_by_one(other, motors, effort, magnet)
        for part in ("qpos", "qvel", "qacc", "ctrl", "sensordata", "xfrc_applied"):
            assert np.array_equal(getattr(one.data, part), getattr(other.data, part)), part
        first, second = one.sense(), other.sense()
        assert np.array_equal(first.hil[1], second.hil[1])
        assert np.array_equal(first.hil[2], second.hil[2])
    assert one.truth().state[0, 2] != 0.0 and one.data.time == pytest.approx(20 * one.period)


@pytest.mark.parametrize(
    "bad", [np.zeros(3, dtype=np.float32), np.zeros((3, 2))[:, 0], [0.0, 0.0, 0.0]]
)
def test_a_sample_that_compiled_code_would_misread_is_refused(bad):
    check_arrays((np.zeros(3), np.zeros(2)))
    with pytest.raises(TypeError, match="contiguous array of float64"):
        check_arrays((np.zeros(3), bad))


@pytest.mark.parametrize("latency", [0, 1, 3])
def test_an_arm_command_arrives_after_the_latency_of_the_bus(latency):
    vehicle = VEHICLES["s500_arm3"].changed({"servos.command_latency_ticks": latency})
    plant, commands = MujocoPlant(vehicle, 0.0, seed=1), []
    plant.tick = 5  # of an earlier simulation
    held = np.zeros(3)
    for k in range(12):
        sent = np.array([0.1 * k, np.nan if k % 3 else -0.2 * k, 0.5])
        plant.step(np.zeros(4), sent, False)
        commands.append(sent)
        if k >= latency:
            due = commands[k - latency]
            held = np.where(np.isnan(due), held, due)
        np.testing.assert_array_equal(plant.servos.command, held)


def test_sense_truth_and_observe_agree():
    one, other = (MujocoPlant(VEHICLES["hexa_arm"], 0.2, seed=1) for _ in range(2))
    row = np.full(one.truth_row.width, np.nan)
    for _ in range(600):  # more than a block of noise
        samples, again = one.sense(), other.observe(row)
        for a, b in ((samples.hil, again.hil), (samples.joints, again.joints)):
            assert a is None or all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
        expected = np.full_like(row, np.nan)
        one.truth_row.write(one.truth(), expected)
        np.testing.assert_array_equal(row, expected)
        for plant in (one, other):
            plant.step(np.full(6, 0.6), np.full(one.joints, 0.1), plant.tick > 300)
    assert row[one.truth_row.magnet] > 0.0 and np.all(row[:6] != 0.0)


def test_a_sample_is_never_overwritten():
    plant = MujocoPlant(VEHICLES["s500_arm3"], 0.0, seed=1)
    first = plant.sense().hil
    kept = [array.copy() for array in first[1:]]
    for _ in range(600):
        plant.sense()
    for array, was in zip(first[1:], kept, strict=True):
        np.testing.assert_array_equal(array, was)


@pytest.mark.skipif(not active(), reason="in plain Python it ends the process")
@pytest.mark.parametrize("effects", [{}, {"rotor_spread": presets.laboratory()["rotor_spread"]}])
def test_an_internal_error_of_mujoco_ends_the_flight_not_the_process(effects):
    scenario, vehicle = load_scenario("hover"), Vehicle.load().changed({"effects": effects})
    flight = DirectFlight(scenario, load_profile("s500"), vehicle, 0.0, seed=1)

    def break_it(time, phase):
        flight.plant.model.opt.integrator = 99

    flight.run(break_it)
    assert flight.ended_by == "the simulation cannot go on: MuJoCo: mj_step: invalid integrator"
    assert flight.recording.count > 200 and np.isfinite(flight.recording.values[200, 0])
    sound = MujocoPlant(Vehicle.load(), 0.0, seed=1)  # another plant of the process goes on
    sound.step(np.zeros(4), np.zeros(2), False)
    with pytest.raises(mujoco.FatalError, match="invalid integrator"):  # so does MuJoCo's own
        mujoco.mj_step(flight.plant.model, flight.plant.data)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_plant_that_becomes_unstable_ends_the_flight(compiled):
    scenario = load_scenario("hover")
    first = None
    for _ in range(2):  # a second one in the same process as the first
        flight = DirectFlight(scenario, load_profile("s500"), Vehicle.load(), 0.0, seed=1)

        def stiffen(time, phase, flight=flight):
            if time > 1.5:  # a spring whose period the step of 2 ms does not follow
                flight.plant.model.jnt_stiffness[flight.plant.model.joint("alpha_1").id] = 1e6

        if not compiled:
            flight.advance = lambda enough, most, flight=flight: flight.tick()
        rows = flight.run(stiffen)
        assert flight.ended_by.startswith("the simulation cannot go on: it is unstable; ")
        assert "timestep below 0.002 s (MuJoCo: Nan" in flight.ended_by
        assert "\n" not in flight.ended_by
        heights = rows.series()["truth.z"]
        assert rows.count < 1500 and heights[400] > 0.1  # in flight; none is of a fresh model
        first = first or (rows.count, flight.ended_by)
        assert (rows.count, flight.ended_by) == first
