"""Settings of all tests."""

import sys
from pathlib import Path

from hypothesis import settings

# The first call of a compiled function takes seconds; a run must not depend on chance.
settings.register_profile("uam", deadline=None, derandomize=True)
settings.load_profile("uam")

# helper modules that several test folders import, and what the benchmarks are made of
TESTS = Path(__file__).parent
sys.path[:0] = [str(TESTS), str(TESTS.parent / "benchmarks")]
