"""Settings of all tests."""

from hypothesis import settings

# The first call of a compiled function takes seconds; a run must not depend on chance.
settings.register_profile("uam", deadline=None, derandomize=True)
settings.load_profile("uam")
