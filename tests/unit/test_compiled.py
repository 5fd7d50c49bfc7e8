"""Compiled and plain code are the same function."""

import json
import subprocess
import sys

import numpy as np
import pytest

from uam_control.maths import compiled

PROGRAM = """
import json, sys
if {without_numba}: sys.modules["numba"] = None  # as if it were not installed
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flight.direct.flight import DirectFlight
from uam_sim_bridge.plant import Vehicle
sets = load_scenario("pick_and_place"), load_profile({profile!r}), Vehicle.load()
flight = DirectFlight(*sets, 0.2, 1)
while flight.mission.output.time < 1.5:
    flight.tick()
print(json.dumps(flight.recording.values[flight.recording.count - 1].tolist()))
"""


def flown(profile: str, without_numba: bool) -> list:
    """The last row of the first seconds of a flight."""
    program = PROGRAM.format(profile=profile, without_numba=without_numba)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("profile", ["s500", "asmc1", "asmc2"])
def test_without_numba_a_flight_is_the_same_up_to_rounding(profile):
    fast, plain = flown(profile, False), flown(profile, True)
    np.testing.assert_allclose(fast, plain, rtol=1e-6, atol=1e-7)


def test_identity_without_numba(monkeypatch):
    monkeypatch.setattr(compiled, "numba", None)

    def function(x):
        return 2 * x

    assert compiled.jit(function) is function
