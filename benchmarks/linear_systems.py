"""Time of the linear analysis: blocks of `uam margins` against the library `control`.

    .venv/bin/python benchmarks/linear_systems.py      (needs `pip install control`)

Both join the blocks of the stack in hover and compute the response between all signals at which
loops are opened, at the frequencies of `uam margins`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import control
import numpy as np

from uam_control.profiles.profile import load_profile
from uam_lab.experiments.margins.linear import IN, join
from uam_lab.experiments.margins.loops import FREQUENCIES, LOWEST, loops_of
from uam_lab.experiments.margins.stack_model import THRUST, Stack, stack_model
from uam_sim_bridge.plant import Vehicle


def own(stack: Stack, signals: list[str], z: np.ndarray) -> tuple[Any, Callable[[], np.ndarray]]:
    """Return the joined blocks, and their response (k, m, m) as a function."""
    whole = join(stack.blocks, added=signals).only([IN + name for name in signals], signals)
    return whole, lambda: whole.response(z)


def library(stack: Stack, signals: list[str], z: np.ndarray) -> tuple[Any, Callable]:
    """Return the same by `control`: a sum before each signal adds the input of its name."""

    def named(names: Sequence[str]) -> list[str]:
        """Return names that the library allows: without points and colons."""
        return [one.replace(".", "__").replace(":", "__") for one in names]

    added = set(named(signals))
    blocks = []
    for block in stack.blocks:
        outputs = [one + "__own" * (one in added) for one in named(block.outputs)]
        blocks.append(
            control.ss(
                block.a, block.b, block.c, block.d, stack.period,
                inputs=named(block.inputs), outputs=outputs,
            )
        )  # fmt: skip
    inputs, sums = named([IN + name for name in signals]), named(signals)
    outputs = [f"{one}__own" for one in sums]
    blocks += [
        control.summing_junction([one, given], total)
        for one, given, total in zip(outputs, inputs, sums, strict=True)
    ]
    whole = control.interconnect(
        blocks, inputs=inputs, outputs=outputs, dt=stack.period, check_unused=False
    )
    return whole, lambda: np.moveaxis(whole(z), 2, 0)


def main() -> None:
    """Print the time of joining and of the response, and by how much the two differ."""
    stack = stack_model(load_profile("s500"), Vehicle.load())
    found = [signal for loop in loops_of(stack.coordinates) for signal in loop.signals]
    signals = [*dict.fromkeys(found), THRUST]
    omega = np.geomspace(LOWEST, np.pi / stack.period * (1.0 - 1e-6), FREQUENCIES)
    z, results = np.exp(1j * omega * stack.period), []
    for name, make in (("own", own), ("control", library)):
        begun = time.process_time()
        _, respond = make(stack, signals, z)
        joined = time.process_time()
        results.append(respond())
        ended = time.process_time()
        print(f"{name:<10} join {joined - begun:.3f} s, response {ended - joined:.3f} s")
    scale = np.abs(results[0]).max()
    print(f"largest difference {np.abs(results[0] - results[1]).max() / scale:.1e} of the largest")


if __name__ == "__main__":
    main()
