"""Steady ticks: many ticks of a direct flight in one compiled call, while nothing is to be decided.

Most ticks of a flight only compute: no phase changes, no limit is near, nobody takes over. Python
needs most of their time for the way from one compiled function to the next. Here the stages of a
tick are one compiled loop of the same functions, in the order of `stages.control_tick.STAGES`.

Each stage has a part: it copies the state of its objects into arrays (`load`), runs compiled, and
copies the state back (`store`). Before it changes anything, a compiled stage looks whether there is
something to decide: a pose that jumps, a value beyond a limit. If so, the loop ends there,
and the objects themselves do this stage and the rest of the tick. So all decisions are made by the
objects, and a recording is the same bit for bit (tests/flights/test_steady_ticks.py).

The parts read and write private attributes of the objects, which know nothing of them: in a node
nobody copies their state. Whoever changes the state of a stage changes its part, too; the test
notices what is missing.

A flight with faults, effects, a plant or a setpoint of its own is flown by the objects alone; see
`able` of the parts.
"""
