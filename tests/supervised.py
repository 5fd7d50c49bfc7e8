"""A supervisor in flight, for tests: observations, steps, decisions."""

from __future__ import annotations

import dataclasses

import numpy as np

from uam_control.supervision import Observation, State, SupervisionParameters, Supervisor
from uam_control.vehicle import derived_parameters, load_description

S500 = SupervisionParameters.among(derived_parameters(load_description())["mission"], 2)


def observation(**changes):
    """Return an observation without tracking error, 1 m above the start."""
    state, reference = np.zeros((3, 8)), np.zeros((3, 8))
    state[0, 2] = reference[0, 2] = 1.0
    seen = Observation(state, reference, 0.0, armed=True, ready=True)
    for name, value in changes.items():
        setattr(seen, name, value)
    return seen


def flying(**parameters):
    """A supervisor after take-off, and the time of its steps."""
    made = Supervisor(dataclasses.replace(S500, **parameters).validated(2))
    made.start()
    for stamp in (0.0, 0.01):
        made.step(stamp, observation())
    assert made.state is State.FLYING
    return made


def watch(supervisor, seen, seconds, begin=1.0):
    """Step for a while; return the last decision."""
    for k in range(round(seconds / 0.01) + 1):
        decision = supervisor.step(begin + 0.01 * k, seen)
    return decision


def with_state(entry, value):
    seen = observation()
    seen.state[entry] = value
    return seen


def mermaid(transitions, first, last, group):
    """Return transitions as a mermaid state diagram, one arrow per pair of states; what leads out
    of each state of `group` to one target leads out of the group."""
    named = {state: state.value.replace(" ", "_") for state in type(first)}
    transitions = sorted(transitions, key=lambda it: list(named).index(it[0]))
    shared = [
        (event, target)
        for source, event, target in transitions
        if source is group[0] and all((state, event, target) in transitions for state in group)
    ]
    arrows = {}
    for source, event, target in transitions:
        together = source in group and (event, target) in shared
        if not together or source is group[0]:
            pair = "scenario" if together else named[source], named[target]
            arrows.setdefault(pair, []).append(event.value)
    lines = ["stateDiagram-v2", "    state scenario {"]
    lines += [f"        {named[state]}" for state in group]
    lines += ["    }", f"    [*] --> {named[first]}"]
    lines += [
        f"    {source} --> {target}: {' / '.join(events)}"
        for (source, target), events in arrows.items()
    ]
    lines.append(f"    {named[last]} --> [*]")
    return "\n".join(lines)
