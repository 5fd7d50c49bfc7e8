"""Steady ticks: many ticks of a direct flight in one compiled call, while nothing is to be decided.

Most ticks of a flight only compute: no phase changes, no limit is near, nobody takes over. Python
needs most of their time for the way from one compiled function to the next. Here the stages of a
tick are one compiled loop of the same functions, in the order of `stages.control_tick.STAGES`, on
the arrays of the objects themselves.

Before it changes anything, a compiled stage looks whether there is something to decide: a link that
is silent, a value beyond a limit. If so, the loop ends there, and the objects themselves do this
stage and the rest of the tick. So all decisions are made by the objects, and a recording is the
same bit for bit (tests/flights/test_steady_ticks.py).

The state of the mission (`ReferencePart`) and the messages that wait for the supervisor
(`KeptMessages`) are still copied: `load` before the loop, `store` after it. Whoever changes that
state changes its part, too; the test notices what is missing.

A flight with faults, effects, a plant or a setpoint of its own is flown by the objects alone.
"""
