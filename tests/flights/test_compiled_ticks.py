"""Compiled ticks: a flight in compiled loops is the flight of the objects, bit for bit."""

from __future__ import annotations

import dataclasses
import gc
import weakref

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from longer import longer

from uam_control.estimation.pose_filter import parts_of
from uam_control.mission import load_scenario
from uam_control.offboard.modes import Mode
from uam_control.profiles.profile import default_profile, load_profile
from uam_control.supervision import OperatorCommand, State
from uam_control.vehicle import load_description
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.faults.schedule import read_schedule
from uam_sim_bridge.plant import PhysicsError, Vehicle
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.sensors import VEHICLE_POSE, WAITING

GUSTS = {"wind": [1.0, 0.5, 0.0], "gust": 1.0}


def flight(scenario="hover", law="modular", vehicle="s500_arm", payload=0.2, seed=1, **more):
    """Return a flight; air: changes of the vehicle's; effects: of the plant; profile: names after
    that of the law."""
    described = load_description(vehicle)
    flown, profile = Vehicle.of(described), default_profile(law, described)
    if air := more.pop("air", None):
        flown = flown.changed({"air": {**flown.numbers["air"], **air}})
    if effects := more.pop("effects", None):
        flown = flown.changed({"effects": effects})
    if further := more.pop("profile", None):
        profile = load_profile("s500", further)
    return DirectFlight(load_scenario(scenario, described), profile, flown, payload, seed, **more)


def over(one):
    """Whether mission and vehicle are at their end."""
    return one.mission.output.done and not one.armed


def fly_objects(one, until):
    """Fly to tick `until` by the objects alone."""
    while one.plant.tick < until and not over(one):
        one.tick()


def fly_compiled(one, until):
    """Fly to tick `until`, compiled where it may be."""
    while one.plant.tick < until and not over(one):
        one.advance(until - one.plant.tick, until - one.plant.tick)


def assert_same(compiled, objects):
    """Assert that both have recorded and decided the same."""
    found, expected = compiled.recording, objects.recording
    assert compiled.plant.tick == objects.plant.tick
    assert found.count == expected.count
    assert found.phase_names == expected.phase_names
    np.testing.assert_array_equal(found.phases[: found.count], expected.phases[: found.count])
    rows, other = found.values[: found.count], expected.values[: found.count]
    different = np.flatnonzero(np.any(rows.view(np.int64) != other.view(np.int64), axis=1))
    if len(different):
        row = different[0]
        names = np.array(found.columns.names)[rows[row].view(np.int64) != other[row].view(np.int64)]
        pytest.fail(f"row {row}, {rows[row, 0]:.3f} s: {', '.join(names[:5])}")
    assert compiled.mission.changes == objects.mission.changes
    assert compiled.mission.grasps == objects.mission.grasps
    assert vars(compiled.mission.output).keys() == vars(objects.mission.output).keys()


END = 100_000  # ticks: later than any end


@pytest.mark.parametrize(
    ("options", "share"),
    [
        longer({"scenario": "circle"}, 0.85),  # a CSV file: no moves
        ({"scenario": "quick_pick"}, 0.6),
        ({"scenario": "quick_pick", "seed": 3, "air": GUSTS}, 0.4),  # the clock stops, shifts
        longer({"scenario": "hover", "law": "asmc1"}, 0.75),
        longer({"scenario": "hover", "law": "asmc2"}, 0.75),
        longer({"scenario": "hover", "vehicle": "hexa_arm"}, 0.75),
        ({"scenario": "arm3_motions", "vehicle": "s500_arm3"}, 0.75),
    ],
    ids=lambda value: "-".join(map(str, value.values())) if isinstance(value, dict) else "",
)
def test_a_flight_is_recorded_the_same(options, share):
    compiled, objects = flight(**options), flight(**options)
    whole = options == {"scenario": "quick_pick"}
    until = END if whole else 3000  # the objects take a millisecond each
    fly_compiled(compiled, until)
    fly_objects(objects, until)
    assert_same(compiled, objects)
    assert compiled.mission.output.phase == "landed" or not whole
    assert compiled.compiled.ticks > share * compiled.plant.tick


@settings(max_examples=3, deadline=None)
@given(
    st.lists(st.tuples(st.booleans(), st.integers(1, 400)), min_size=3, max_size=12),
    st.integers(1, 1000),
)
def test_it_may_change_between_both_at_any_tick(stretches, seed):
    mixed, objects = flight(seed=seed), flight(seed=seed)
    fly_objects(mixed, 600)  # in the air
    for is_compiled, ticks in stretches:
        (fly_compiled if is_compiled else fly_objects)(mixed, mixed.plant.tick + ticks)
    fly_objects(objects, mixed.plant.tick)
    assert_same(mixed, objects)


def waiting_poses(one):
    """Return the poses that have not arrived, views."""
    a = one.plant.arrays.mocap
    first, count = a.first[VEHICLE_POSE], a.count[VEHICLE_POSE]
    assert count > 1
    return [a.poses[VEHICLE_POSE, (first + i) % WAITING] for i in range(count)]


def late_poses(one):
    """Move the next pose by a metre: the estimator refuses it."""
    waiting_poses(one)[-1][1:4] += 1.0


def frozen_poses(one):
    """Let all poses of a moment be the same: a frozen tracker."""
    first, *others = waiting_poses(one)
    for pose in others:
        pose[1:] = first[1:]


def broken_estimate(one):
    """Let the estimate diverge."""
    memory = one.control.estimator.estimator.arrays.pose.memory
    parts_of(memory)[0].velocity[0] = np.nan


def storm(one):
    """Blow the vehicle away: limits are exceeded."""
    one.plant.body.wind_mean[:] = 14.0, 0.0, 0.0


def hold(one):
    """Hold by command."""
    assert one.mission.request(OperatorCommand.HOLD)[0]


def land(one):
    """Land by command."""
    assert one.mission.request(OperatorCommand.LAND)[0]


def pilot(one):
    """Take over by the pilot's switch."""
    one.autopilot.autopilot.commander.request_mode(one.plant.time, Mode.HOLD, True)


def magnet(one):
    """Switch the magnet on by command."""
    assert one.mission.switch_magnet(True)[0]


def gains(one):
    """Change parameters in flight."""
    controller = one.control.attitude.controller
    p = controller.parameters
    changed = tuple(2.0 * value for value in p.feedforward_washout)
    controller.set_parameters(dataclasses.replace(p, feedforward_washout=changed, prediction=0.01))


def full_table(one):
    """Let the table be full soon."""
    table = one.recording
    table.values, table.phases = table.values[: table.count + 7], table.phases[: table.count + 7]


@pytest.mark.parametrize(
    "change",
    [
        *(late_poses, broken_estimate, hold, pilot, gains, full_table),
        *map(longer, (frozen_poses, storm, land, magnet)),
    ],
)
def test_an_incident_is_the_same(change):
    compiled, objects = flight(), flight()
    for one, fly in ((compiled, fly_compiled), (objects, fly_objects)):
        fly_compiled(one, 1501)  # in the air; the same by both, see above
        assert one.mission.output.state is State.FLYING
        change(one)
        fly(one, 2700)
    assert_same(compiled, objects)
    assert compiled.compiled.ticks > 800  # it was compiled before


def test_an_error_of_the_physics_has_its_text():
    one = flight()
    fly_compiled(one, 1501)
    one.plant.model.opt.integrator = 99
    with pytest.raises(PhysicsError, match="MuJoCo: mj_step: invalid integrator"):
        fly_compiled(one, 1600)


def test_it_ends_at_the_tick_that_was_asked_for():
    one = flight()
    for tick in (700, 701, 703, 850, 1100):
        fly_compiled(one, tick)
        assert one.plant.tick == tick
    one.advance(10, 1000)  # enough, most
    assert 1110 <= one.plant.tick <= 2100


@pytest.mark.parametrize(
    "options",
    [
        {"faults": ["mocap_dropout@2.5+0.3", "imu_dropout@3.5+0.02"]},
        longer({"faults": ["mavlink_delay@2.5+1"]}),
        longer({"faults": ["wind_gust@2.5+1.5"]}),  # rises: it acts, but senses nothing
        {"autopilot_imu": True},
        {"profile": "attitude_setpoints"},
        longer({"effects": presets.laboratory()}),
        {"effects": presets.laboratory(), "faults": ["imu_bias@2.5+1"]},
    ],
    ids=lambda options: "-".join(options),
)
def test_a_part_in_python_splits_the_loop(options):
    if faults := options.get("faults"):
        options = options | {"faults": read_schedule(faults, load_scenario("hover"), seed=1)}
    compiled, objects = flight(**options), flight(**options)
    fly_compiled(compiled, 2000)
    fly_objects(objects, 2000)
    assert_same(compiled, objects)
    assert compiled.compiled.ticks > 600


@pytest.mark.parametrize("before", ["estimator", "position law", "next reference"])
def test_a_stage_of_somebodys_own_sees_and_changes_what_it_does_without_compiled_ticks(before):
    def stage(seen):
        def run(control):
            s = control.signals
            if before == "estimator" and s.imu is not None:
                s.imu = s.imu[0], s.imu[1] + 0.01, s.imu[2]
            elif before == "position law":
                s.reference[0, 1] += 0.02
            seen.append((s.stamp, s.time, s.phase, s.tau_p.tolist(), repr(s.setpoint)))
            return True

        return run

    found = [], []
    compiled, objects = flight(), flight()
    for one, seen in zip((compiled, objects), found, strict=True):
        one.control.insert(before, "own", stage(seen))
    fly_compiled(compiled, 1500)
    fly_objects(objects, 1500)
    assert_same(compiled, objects)
    assert found[0] == found[1]
    assert compiled.compiled.ticks > 500


def test_a_law_of_somebodys_own_may_be_plain_python(monkeypatch):
    law = type(flight().control.position.controller.law)
    monkeypatch.setattr(law, "step", staticmethod(getattr(law.step, "py_func", law.step)))
    compiled, objects = flight(), flight()
    fly_compiled(compiled, 1200)
    fly_objects(objects, 1200)
    assert_same(compiled, objects)
    assert compiled.compiled.ticks > 300


@pytest.fixture
def allocations():
    """Return how many of numba's allocations were made and freed."""
    memory = numba.core.runtime._nrt_python
    memory.memsys_enable_stats()

    def made_and_freed():
        found = numba.core.runtime.rtsys.get_allocation_stats()
        return np.array([found.mi_alloc, found.mi_free])

    yield made_and_freed
    memory.memsys_disable_stats()


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="NUMBA_DISABLE_JIT: nothing is compiled")
def test_no_memory_is_left_behind(allocations):
    one = flight()
    fly_compiled(one, 800)
    before = allocations()
    fly_compiled(one, 2300)
    made, freed = allocations() - before
    assert one.compiled.ticks > 1000
    assert made == freed > 1000


def test_a_flight_is_freed_with_its_last_reference():
    """Garbage collection alone would come late: a flight has megabytes, a campaign thousands."""
    one = flight()
    fly_compiled(one, 1000)
    assert one.compiled.ticks
    watched = weakref.ref(one)
    gc.disable()
    try:
        del one
        assert watched() is None
    finally:
        gc.enable()
