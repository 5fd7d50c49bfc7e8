"""A clock whose time the test sets."""


class SetClock:
    """Returns `now`, in whatever unit the test uses."""

    def __init__(self, now=0.0):
        self.now = now

    def __call__(self):
        return self.now
