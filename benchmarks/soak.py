"""Fly for hours and check that memory, file handles, threads and the log stay bounded.

    .venv/bin/python benchmarks/soak.py --minutes 60                          # nodes, real time
    .venv/bin/python benchmarks/soak.py --minutes 600 --clock lockstep        # as fast as possible
    .venv/bin/python benchmarks/soak.py --minutes 600 --clock lockstep --fused    # one process
    .venv/bin/python benchmarks/soak.py --minutes 600 --engine direct         # missions in a row

With nodes it is one flight to and fro with a moving arm, and all further options are those of
uam fly, for example --fifo 1 or --inner-rate 25; with the direct engine it is many missions in one
process. Every process is sampled every few seconds. Writes soak.json and soak.png to --out;
the exit status is 1 if memory, handles or threads have grown. Ctrl-C ends the flight; the samples
up to then are evaluated.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from pathlib import Path

from soaking import judgement, picture, watch

FAILED, INTERRUPTED = 1, 130


def main() -> int:
    """Fly, evaluate, print; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,  # an option of uam fly is not a short form of one here
    )
    option = parser.add_argument
    option("--minutes", type=float, default=60.0, help="of simulated time (default %(default)g)")
    option("--engine", choices=("ros", "direct"), default="ros", help="(default %(default)s)")
    option(
        "--clock",
        choices=("realtime", "lockstep"),
        default="realtime",
        help="of the nodes (default %(default)s)",
    )
    option("--log-limit", type=float, default=200.0, help="[MB] of the log (default %(default)g)")
    option("--out", type=Path, default=Path("results/soak"), help="(default %(default)s)")
    options, further = parser.parse_known_args()
    if options.minutes < 2.0:
        parser.error("--minutes is 2 or more: what grows is not to be seen earlier")
    if further and options.engine == "direct":
        parser.error(f"{further[0]} needs --engine ros: the direct engine has no nodes")
    options.out.mkdir(parents=True, exist_ok=True)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the flight must not fly on alone
    duration = 60.0 * options.minutes
    if options.engine == "direct":
        soak = watch.missions(duration)
    else:
        soak = watch.flight(duration, options.clock, options.log_limit, options.out, further)
    verdicts = judgement.judge(soak)
    if verdicts:
        print(judgement.table(verdicts))
    for line in soak.notes:
        print(line)
    if not verdicts:
        return FAILED
    (options.out / "soak.json").write_text(json.dumps(soak.to_mapping(verdicts), indent=1))
    picture.draw(soak, options.out / "soak.png")
    print(f"picture  {options.out / 'soak.png'}")
    if soak.interrupted:
        print("soak: interrupted", file=sys.stderr)
        return INTERRUPTED
    return FAILED if soak.failed or any(one.grown for one in verdicts) else 0


if __name__ == "__main__":
    raise SystemExit(main())
