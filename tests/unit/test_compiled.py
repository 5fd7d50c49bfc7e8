"""Compiled and plain code are the same function."""

import json
import subprocess
import sys

import numpy as np
import pytest
from longer import longer

from uam_control.laws.law import LawInputs
from uam_control.maths import compiled
from uam_control.maths.rotations import tilt

PROGRAM = """
import json, sys
if {without_numba}: sys.modules["numba"] = None  # as if it were not installed
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.plant import Vehicle
sets = load_scenario("pick_and_place"), load_profile({profile!r}), Vehicle.load()
flight = DirectFlight(*sets, 0.2, 1)
while flight.mission.output.time < 1.0:
    flight.advance(10, 10)
print(json.dumps(flight.recording.values[flight.recording.count - 1].tolist()))
"""


def flown(profile: str, without_numba: bool) -> list:
    """The last row of the first seconds of a flight."""
    program = PROGRAM.format(profile=profile, without_numba=without_numba)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    "profile",
    ["s500", *(longer(one) for one in ("asmc1", "asmc2"))],
)
def test_without_numba_a_flight_is_the_same_up_to_rounding(profile):
    fast, plain = flown(profile, False), flown(profile, True)
    np.testing.assert_allclose(fast, plain, rtol=1e-6, atol=1e-7)


def test_identity_without_numba(monkeypatch):
    monkeypatch.setattr(compiled, "numba", None)

    def function(x):
        return 2 * x

    assert compiled.jit(function) is function


@compiled.jit
def summed(inputs, factor, out):
    """Write the sum of two rows of a named tuple of arrays."""
    for i in range(len(out)):
        out[i] = factor * (inputs.e[i] + inputs.e_dot[i])


@pytest.mark.parametrize("length", [1, 2, 3])
def test_a_prepared_function_is_the_function(length):
    e, e_dot = np.random.default_rng(length).normal(size=(2, length))
    out, same = np.zeros(length), np.zeros(length)
    inputs = LawInputs(e, e_dot, e, e, False, False, 0.0)
    call = compiled.prepared(summed, inputs, 1.0, out)
    summed(inputs, 3.0, same)
    call(inputs, 3.0, out)
    assert np.array_equal(out, same) and np.array_equal(out, 3.0 * (e + e_dot))
    call(inputs, 2, out)  # a whole number is a number
    assert np.array_equal(out, 2.0 * (e + e_dot))


def test_a_prepared_function_serves_arrays_of_any_length():
    call = compiled.prepared(tilt, np.zeros(3))
    assert call(np.array([0.1, 0.0, 5.0, 9.0])) == pytest.approx(0.1)


def test_a_function_without_machine_code_is_prepared_as_it_is():
    def function(x):
        return 2 * x

    assert compiled.prepared(function, 1.0) is function


def test_with_a_numba_that_always_counts_references_no_function_borrows(monkeypatch):
    monkeypatch.setattr(compiled, "_COUNTS", "")

    def double(x):
        return 2 * x

    plain, borrowing = compiled.jit(double), compiled.borrowing(double)
    assert plain(3) == borrowing(3) == 6
    assert not compiled.active() or not compiled.counts_references(plain)
