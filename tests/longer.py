"""Cases of `make long`."""

import pytest


def longer(*values, **more):
    """Return a further case of a test; `make test` runs one of its kind. more: see pytest.param."""
    return pytest.param(*values, marks=pytest.mark.long, **more)
