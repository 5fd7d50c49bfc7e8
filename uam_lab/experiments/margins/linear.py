"""Linear discrete-time blocks with named signals: x+ = A x + B u, y = C x + D u.

`linearise` makes a block from a function and the arrays in which its objects keep their state;
`join` connects the blocks by the names of their signals.

Margins: the open loop L is that of negative feedback: the closed loop is stable up to 1 + L = 0.
Crossings are interpolated between the frequencies.
"""

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment

TOGETHER = 100  # frequencies that are solved together
STEP = 1e-6  # of inputs and states, for the central differences
IN = "in:"  # prefix of an input of a joined block that opens, or adds to, the signal of that name
MODULES = "uam_"  # packages whose objects are searched for arrays
TINY = 1e-30  # of a loop or an eigenvalue: one that acts on nothing is 0


@dataclass(frozen=True)
class LinearBlock:
    """A linear system with m inputs, p outputs and n states; the time step is that of the model."""

    a: np.ndarray  # (n, n)
    b: np.ndarray  # (n, m)
    c: np.ndarray  # (p, n)
    d: np.ndarray  # (p, m)
    inputs: tuple[str, ...]  # (m) names of the signals
    outputs: tuple[str, ...]  # (p) names of the signals

    def response(self, z: np.ndarray) -> np.ndarray:
        """Return the transfer matrices (k, p, m) at the complex numbers z (k,)."""
        identity, parts = np.eye(len(self.a)), []
        for some in np.array_split(z, max(1, len(z) // TOGETHER)):
            solved = np.linalg.solve(some[:, None, None] * identity - self.a, self.b)
            parts.append(self.c @ solved + self.d)
        return np.concatenate(parts)

    def only(self, inputs: Sequence[str], outputs: Sequence[str]) -> Self:
        """Return the block with these inputs and outputs, in this order."""
        m = [self.inputs.index(name) for name in inputs]
        p = [self.outputs.index(name) for name in outputs]
        b, c, d = self.b[:, m], self.c[p], self.d[np.ix_(p, m)]
        return LinearBlock(self.a, b, c, d, tuple(inputs), tuple(outputs))

    def simulate(self, inputs: np.ndarray) -> np.ndarray:
        """Return the outputs (steps, p) for inputs (steps, m), from rest."""
        state, found = np.zeros(len(self.a)), np.empty((len(inputs), len(self.outputs)))
        for k, u in enumerate(inputs):
            found[k] = self.c @ state + self.d @ u
            state = self.a @ state + self.b @ u
        return found

    def reduced(self) -> Self:
        """Return the block without states that influence neither an output nor another state."""
        block = self
        while True:
            seen = np.any(np.vstack([block.a, block.c]) != 0.0, axis=0)
            if seen.all():
                return block
            a, b, c = block.a[np.ix_(seen, seen)], block.b[seen], block.c[:, seen]
            block = LinearBlock(a, b, c, block.d, block.inputs, block.outputs)


def delay(inputs: Sequence[str], outputs: Sequence[str], ticks: int) -> LinearBlock:
    """Return the block that delays each of `inputs` by `ticks` and names it as in `outputs`."""
    width, size = len(inputs), ticks * len(inputs)
    a, b = np.eye(size, k=-width), np.eye(size, width)
    c, d = np.eye(size)[size - width :] if ticks else np.zeros((width, 0)), np.zeros((width, width))
    return LinearBlock(a, b, c, d if ticks else np.eye(width), tuple(inputs), tuple(outputs))


def join(blocks: Iterable[LinearBlock], added: Collection[str] = ()) -> LinearBlock:
    """Connect each input with the output of the same name; return the whole as a block.

    added: signals to which the input IN + name is added. Inputs that no block drives stay inputs.
    Raises ValueError for two outputs of one name.
    """
    blocks = list(blocks)
    outputs = [name for block in blocks for name in block.outputs]
    inputs = [name for block in blocks for name in block.inputs]
    if len(set(outputs)) < len(outputs):
        raise ValueError(f"two outputs of one name among {outputs}")
    free = [name for name in dict.fromkeys(inputs) if name not in outputs]
    free += [IN + name for name in added]
    feedback = np.zeros((len(inputs), len(outputs)))
    outside = np.zeros((len(inputs), len(free)))
    for row, name in enumerate(inputs):
        if name in added:
            outside[row, free.index(IN + name)] = 1.0
        elif name not in outputs:
            outside[row, free.index(name)] = 1.0
        if name in outputs:
            feedback[row, outputs.index(name)] = 1.0
    a, b, c, d = (block_diag(*(getattr(block, part) for block in blocks)) for part in "abcd")
    loop = np.linalg.inv(np.eye(len(inputs)) - feedback @ d)
    of_state, of_input = loop @ feedback @ c, loop @ outside
    return LinearBlock(
        a + b @ of_state,
        b @ of_input,
        c + d @ of_state,
        d @ of_input,
        tuple(free),
        tuple(outputs),
    )


def linearise(
    step: Callable[[np.ndarray], np.ndarray],
    objects: Sequence[Any],
    inputs: Sequence[str],
    outputs: Sequence[str],
    at: np.ndarray | None = None,
) -> LinearBlock:
    """Return the block of `step`: inputs (m,) → outputs (p,), by central differences.

    objects: what keeps the state between two steps; every float array that can be reached from them
    and changes is a state. at (m,): the operating point, None for zero; the objects must be at rest
    there. Their arrays have the old values afterwards.
    """
    at = np.zeros(len(inputs)) if at is None else np.array(at, dtype=float)
    arrays = list(arrays_of(*objects))
    rest = _read(arrays)

    def run(state: np.ndarray, given: np.ndarray) -> np.ndarray:
        """Return the outputs and the next state (p + n,)."""
        _write(arrays, state)
        found = np.array(step(given), dtype=float)
        return np.concatenate([found, _read(arrays)])

    # what neither input changes nor changes by itself is no state
    changed = np.zeros(len(rest), dtype=bool)
    for sign in (1.0, -1.0):
        state = rest
        for _ in range(3):
            state = run(state, at + sign * STEP * np.arange(1.0, len(at) + 1.0))[len(outputs) :]
            changed |= state != rest
    states = np.flatnonzero(changed & np.isfinite(rest))

    def slope(at_state: np.ndarray, at_input: np.ndarray) -> np.ndarray:
        """Return the change of outputs and next state (p + n,) along a change of both."""
        difference = run(rest + at_state, at + at_input) - run(rest - at_state, at - at_input)
        return difference / (2.0 * STEP)

    no_state, no_input = np.zeros(len(rest)), np.zeros(len(at))
    with np.errstate(invalid="ignore"):  # arrays that are no states may be infinite
        by_input = [slope(no_state, change) for change in STEP * np.eye(len(at))]
        by_state = []
        for index in states:
            change = no_state.copy()
            change[index] = STEP
            by_state.append(slope(change, no_input))
    size = len(outputs) + len(rest)
    by_input = np.reshape(by_input, (len(at), size)).T
    by_state = np.reshape(by_state, (len(states), size)).T
    _write(arrays, rest)
    rows, count = len(outputs) + states, len(outputs)
    return LinearBlock(
        by_state[rows],
        by_input[rows],
        by_state[:count],
        by_input[:count],
        tuple(inputs),
        tuple(outputs),
    ).reduced()


def arrays_of(*objects: Any) -> list[np.ndarray]:
    """Return the float64 arrays that own their data and are reachable from attributes of `objects`.

    Lists, tuples and dictionaries are followed, and objects of this project's classes.
    """
    found: dict[int, np.ndarray] = {}
    seen: set[int] = set()
    waiting = list(objects)
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            while isinstance(one.base, np.ndarray):
                one = one.base
            if one.dtype == np.float64 and one.flags.writeable:
                found[id(one)] = one
        elif isinstance(one, list | tuple):
            waiting += one
        elif isinstance(one, dict):
            waiting += one.values()
        elif type(one).__module__.startswith(MODULES) and not isinstance(one, type):
            waiting += getattr(one, "__dict__", {}).values()
            waiting += [getattr(one, name, None) for name in getattr(one, "__slots__", ())]
    return list(found.values())


def _read(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([one.ravel() for one in arrays] or [np.zeros(0)])


def _write(arrays: Sequence[np.ndarray], values: np.ndarray) -> None:
    begin = 0
    for one in arrays:
        one[...] = values[begin : begin + one.size].reshape(one.shape)
        begin += one.size


@dataclass(frozen=True)
class Margins:
    """Margins of one loop; inf or NaN where the loop has no such crossing."""

    crossover: float  # [rad/s] highest frequency with |L| = 1
    phase: float  # [deg] smallest phase margin
    gain: float  # [dB] by which the gain may grow
    gain_down: float  # [dB] by which it may fall
    delay: float  # [s] that may be added
    bandwidth: float  # [Hz] highest frequency at which |L / (1 + L)| falls below -3 dB
    peak: float  # largest |1 / (1 + L)|


def margins(omega: np.ndarray, loop: np.ndarray) -> Margins:
    """Return the margins of L (k,), complex, at the ascending frequencies omega (k,) [rad/s]."""
    size, angle = np.log(np.maximum(np.abs(loop), TINY)), np.unwrap(np.angle(loop))
    phases, delays, at = [], [], math.nan
    for i, share in _crossings(size):
        at = _between(np.log(omega), i, share)
        at, phase = math.exp(at), _between(angle, i, share)
        left = math.remainder(phase + math.pi, 2.0 * math.pi)  # of the phase above -180 deg
        phases.append(math.degrees(left))
        delays.append((left % (2.0 * math.pi)) / at)
    gains = []
    turned = (angle + math.pi) / (2.0 * math.pi)  # whole numbers: phase of -180 deg
    for whole in range(math.ceil(turned.min()), math.floor(turned.max()) + 1):
        gains += [-_between(size, i, share) for i, share in _crossings(turned - whole)]
    decibel = 20.0 / math.log(10.0)
    closed = np.log(np.maximum(np.abs(loop / (1.0 + loop)), TINY)) + 0.5 * math.log(2.0)
    ends = [math.exp(_between(np.log(omega), i, s)) for i, s in _crossings(closed)]
    return Margins(
        crossover=at,
        phase=min(phases, key=abs, default=math.inf),
        gain=decibel * min((gain for gain in gains if gain > 0.0), default=math.inf),
        gain_down=decibel * -max((gain for gain in gains if gain < 0.0), default=-math.inf),
        delay=min(delays, default=math.inf),
        bandwidth=ends[-1] / (2.0 * math.pi) if ends else math.nan,
        peak=float(np.max(1.0 / np.abs(1.0 + loop))),
    )


def common_delay(omega: np.ndarray, loops: np.ndarray) -> float:
    """Return the delay margin [s] of several signals that are delayed together.

    loops (k, m, m): return matrices at omega (k,) [rad/s], negative feedback. The closed loop is at
    its limit where an eigenvalue of L exp(-j omega T) is -1.
    """
    values = np.linalg.eigvals(loops)
    # one frequency to the next: the eigenvalues in the order that moves them least
    for k in range(1, len(values)):
        distance = np.abs(values[k - 1][:, None] - values[k][None, :])
        values[k] = values[k][linear_sum_assignment(distance)[1]]
    found = [math.inf]
    for column in values.T:
        size, angle = np.log(np.maximum(np.abs(column), TINY)), np.unwrap(np.angle(column))
        for i, share in _crossings(size):
            at = math.exp(_between(np.log(omega), i, share))
            found.append(((_between(angle, i, share) + math.pi) % (2.0 * math.pi)) / at)
    return min(found)


def _crossings(values: np.ndarray) -> list[tuple[int, float]]:
    """Return each zero of values (k,): index before it, and the share of the step up to it."""
    before, after = values[:-1], values[1:]
    found = np.flatnonzero((before > 0.0) != (after > 0.0))
    return [(int(i), float(before[i] / (before[i] - after[i]))) for i in found]


def _between(values: np.ndarray, i: int, share: float) -> float:
    return float(values[i] + share * (values[i + 1] - values[i]))
