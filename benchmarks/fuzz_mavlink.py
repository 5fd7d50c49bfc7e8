"""Fuzzes both ends of the MAVLink links: random bytes, and valid messages mutated.

    .venv/bin/python benchmarks/fuzz_mavlink.py --bytes 50e6 --messages 500000 [--seed 1]

Three targets, each with its real parse path: the bridge (OffboardLink, RateThrustMap and thrust
identification behind a transport in memory), the stand-in autopilot (Server, UdpPort, Companion)
and the plant's HilServer. Checks at every tick:

- no exception is raised,
- every setpoint sent is finite, its thrust 0..1, its rates within the limits,
- the bridge requests arming only while the mission commands it,
- every motor command is finite and 0..1, and 0 at the plant while disarmed,
- the buffers of the framers and the memory of the process are bounded.

Prints one line at the end; after a failure the exit status is 1, and a file contains the seed and
the latest inputs.
"""

from __future__ import annotations

import argparse
import gc
import json
import random
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path

import psutil
from fuzzing.messages import Messages, garbage
from fuzzing.targets import Bridge, Plant, StandIn

KEPT_INPUTS = 64  # ticks


class Campaign:
    """The targets, their latest inputs and the counts."""

    def __init__(self, seed: int) -> None:
        self.seed, self.counts = seed, Counter()
        self.bytes = self.messages = 0
        self.inputs: deque[list[bytes]] = deque(maxlen=KEPT_INPUTS)
        self.stage = ""
        self._targets = [
            Bridge(self._random("bridge"), self.counts),
            StandIn(self._random("UDP"), self.counts, "UDP"),
            StandIn(self._random("TCP"), self.counts, "TCP"),
            Plant(self._random("plant"), self.counts),
        ]

    def _random(self, what: str) -> random.Random:
        return random.Random(f"{self.seed} {what}")

    def random_bytes(self, total: int, progress: Callable[[float], None]) -> None:
        """Feed `total` random bytes to each target in turn, a quarter each."""
        rng = self._random("bytes")
        for turn, target in enumerate(self._targets):
            self.stage = f"random bytes to the {target.name}"
            self.inputs.clear()
            until, tick = total * (turn + 1) // len(self._targets), 0
            while self.bytes < until:
                chunks = [garbage(rng) for _ in range(rng.randint(1, 6))]
                self.bytes += sum(map(len, chunks))
                self._feed(target, chunks)
                tick += 1
                if tick % 500 == 0:
                    progress(self.bytes / total)

    def mutated_messages(self, total: int, progress: Callable[[float], None]) -> None:
        """Feed `total` mutated messages, a share to each target."""
        for turn, target in enumerate(self._targets):
            rng = self._random(f"messages to the {target.name}")
            self.stage = f"mutated messages to the {target.name}"
            self.inputs.clear()
            messages = Messages(rng, target.name, self.counts)
            until, tick = total * (turn + 1) // len(self._targets), 0
            while self.messages < until:
                chunks = []
                for _ in range(rng.randint(1, 6)):
                    data, number = messages.chunk()
                    self.messages += number
                    if chunks and rng.random() < 0.3:  # several in one datagram
                        data = chunks.pop() + data
                    if data:
                        chunks.append(data)
                self._feed(target, chunks)
                tick += 1
                if tick % 500 == 0:
                    progress(self.messages / total)

    def _feed(self, target, chunks: list[bytes]) -> None:
        self.inputs.append(list(chunks))
        target.feed(chunks)

    def save(self, file: Path) -> None:
        """Write the seed and the latest inputs, oldest first."""
        file.write_text(
            json.dumps(
                {
                    "seed": self.seed,
                    "stage": self.stage,
                    "bytes": self.bytes,
                    "messages": self.messages,
                    "error": traceback.format_exc(),
                    "inputs": [[data.hex() for data in chunks] for chunks in self.inputs],
                },
                indent=1,
            )
        )

    def close(self) -> None:
        """Close the sockets."""
        self._targets[-1].close()


def resident() -> float:
    """Return the resident set of this process [MB]."""
    gc.collect()
    return psutil.Process().memory_info().rss / 1e6


def run(
    total_bytes: int, messages: int, seed: int, say: Callable[[str], None]
) -> tuple[Campaign, float]:
    """Feed everything to a new campaign; return it and the growth of the memory [MB].

    Raises the exception of a target, with the attribute `campaign`.
    """
    warm = Campaign(seed + 1_000_000)
    try:
        warm.random_bytes(min(total_bytes, 2_000_000), lambda share: None)
        warm.mutated_messages(min(messages, 20_000), lambda share: None)
    except Exception as error:
        error.campaign = warm
        raise
    finally:
        warm.close()
    del warm
    before = resident()
    campaign = Campaign(seed)
    try:
        campaign.random_bytes(total_bytes, lambda share: say(f"bytes {100 * share:.0f} %"))
        campaign.mutated_messages(messages, lambda share: say(f"messages {100 * share:.0f} %"))
    except Exception as error:
        error.campaign = campaign
        raise
    finally:
        campaign.close()
    return campaign, resident() - before


def main() -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bytes", type=float, default=1e6, help="random bytes (default 1e6)")
    parser.add_argument(
        "--messages", type=float, default=1e4, help="mutated messages (default 1e4)"
    )
    parser.add_argument("--seed", type=int, default=1, help="default 1")
    parser.add_argument(
        "--memory",
        type=float,
        default=8.0,
        metavar="MB",
        help="allowed growth of the memory (default 8)",
    )
    parser.add_argument(
        "--save",
        type=Path,
        default=Path("fuzz_failure.json"),
        metavar="FILE",
        help="file for a failure (default %(default)s)",
    )
    options = parser.parse_args()
    begin = shown = time.monotonic()

    def say(text: str) -> None:
        nonlocal shown
        now = time.monotonic()
        if now - shown >= 5.0:
            shown = now
            print(f"{now - begin:6.0f} s  {text}", flush=True)

    try:
        campaign, grown = run(int(options.bytes), int(options.messages), options.seed, say)
    except Exception as error:
        campaign = error.campaign
        campaign.save(options.save)
        print(
            f"fuzz_mavlink: FAILED with seed {campaign.seed} at {campaign.stage}: "
            f"{type(error).__name__}: {error}; inputs in {options.save}",
            file=sys.stderr,
        )
        return 1
    print("; ".join(f"{what} {count}" for what, count in sorted(campaign.counts.items())))
    flat = grown <= options.memory
    print(
        f"fuzz_mavlink: {campaign.bytes} random bytes, {campaign.messages} mutated messages, "
        f"seed {options.seed}: no failure, memory {grown:+.1f} MB"
        f"{'' if flat else ' MORE THAN ALLOWED'}, {time.monotonic() - begin:.0f} s"
    )
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
