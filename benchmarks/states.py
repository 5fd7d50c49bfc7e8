"""Time of a transition: the table of the supervisor against the library `transitions`.

    .venv/bin/python benchmarks/states.py      (needs `pip install transitions`)

Both go round one flight: ready, airborne, hold, resume, landing due, touchdown. The supervisor also
looks up each event that does not apply in its state; that is what happens at most ticks.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from types import SimpleNamespace

from transitions import Machine

from uam_control.supervision.states import TARGETS, TRANSITIONS, Event, State

ROUNDS = 5_000
FLIGHT = (
    Event.READY, Event.AIRBORNE, Event.HOLD, Event.RESUME, Event.LANDING_DUE, Event.TOUCHDOWN,
)  # fmt: skip


def by_table() -> None:
    """Fly by the look-up that `Supervisor.step` uses."""
    state = State.GROUNDED
    for event in FLIGHT:
        if (state, event) in TARGETS:
            state = TARGETS[state, event]
    assert state is State.DISARMED


def machine() -> Callable[[], None]:
    """Return the flight by a machine of the library with the same transitions."""
    model = SimpleNamespace()
    triggers = [
        {"trigger": event.name, "source": source.name, "dest": target.name}
        for source, event, target in TRANSITIONS
    ]
    states = [state.name for state in State]
    made = Machine(
        model, states=states, transitions=triggers, initial="GROUNDED",
        auto_transitions=False, ignore_invalid_triggers=True,
    )  # fmt: skip

    def fly() -> None:
        made.set_state("GROUNDED")
        for event in FLIGHT:
            model.trigger(event.name)
        assert model.state == "DISARMED"

    return fly


def main() -> None:
    """Print the time of a transition of each."""
    for name, fly in (("table", by_table), ("transitions", machine())):
        begun = time.process_time()
        for _ in range(ROUNDS):
            fly()
        spent = (time.process_time() - begun) / ROUNDS / len(FLIGHT)
        print(f"{name:12} {1e6 * spent:7.2f} us per transition")


if __name__ == "__main__":
    main()
