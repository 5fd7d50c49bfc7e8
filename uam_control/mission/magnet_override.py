"""An operator's word on the magnet, which counts until the scenario switches it next."""

from __future__ import annotations


class MagnetOverride:
    """Override of the scenario's value; none at first."""

    def __init__(self) -> None:
        self._given: tuple[bool, bool] | None = None  # overriding value, scenario's value then

    @property
    def given(self) -> bool:
        """Whether there is one."""
        return self._given is not None

    def give(self, on: bool, scenario: bool) -> None:
        """Override by `on`; scenario: its present value."""
        self._given = on, scenario

    def forget(self) -> None:
        """Override no more."""
        self._given = None

    def value(self, desired: bool) -> bool | None:
        """Return the overriding value, None for none; desired: the scenario's value now."""
        if self._given is None:
            return None
        on, before = self._given
        if desired != before:
            self._given = None
            return None
        return on
