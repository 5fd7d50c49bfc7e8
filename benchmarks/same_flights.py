"""Compares the recordings of this checkout with those of another revision, bit for bit.

    python benchmarks/same_flights.py 4ee583d                 # four flights of each, 5 minutes
    python benchmarks/same_flights.py main --engines direct   # half a minute
    python benchmarks/same_flights.py main --seeds 1 2 3 --scenario quick_pick
    python benchmarks/same_flights.py main --engines direct --seeds 1 --flights all   # 5 minutes
    python benchmarks/same_flights.py main --engines fused --fault mocap_jump@20 --vehicle hexa_arm

The engine `fused` is `ros` with `--fused`. Further options are those of `uam fly`; --flights adds
those of FLIGHTS: laws, vehicles, faults.

Both revisions fly the same scenario on this machine, so that processor and libraries are the same.
A table shows the hash of each recording. Exit status 0: all are equal; 1: some differ; 2: the
revision does not exist or a flight wrote no recording.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
from itertools import product
from pathlib import Path

import pyarrow.parquet as parquet

HERE = Path(__file__).resolve().parents[1]
RUN = "import sys; from {module} import main; sys.exit(main())"
FLIGHTS = {
    "paper": (),
    "asmc1": ("--controller", "asmc1"),
    "asmc2": ("--controller", "asmc2"),
    "Table I": ("--profile", "s500", "--profile", "paper_table1_as_flown"),
    "attitude": ("--profile", "s500", "--profile", "attitude_setpoints"),
    "position": ("--profile", "s500", "--profile", "px4_position"),
    "hexa_arm": ("--vehicle", "hexa_arm"),
    "s500_arm3": ("--vehicle", "s500_arm3", "--scenario", "arm3_motions"),
    "curve": ("--scenario", "lemniscate_payload"),
    "laboratory": ("--plant-preset", "laboratory"),
    "autopilot's IMU": ("--imu", "autopilot"),
    "late links": ("--setpoint-delay", "16", "--mocap-delay", "8", "--mocap-jitter", "4"),
    "dropout": ("--fault", "mocap_dropout@20+3"),
    "freeze": ("--fault", "mocap_freeze@20+0.4"),
    "jump": ("--fault", "mocap_jump@20+5"),
    "outliers": ("--fault", "mocap_outliers@15+10"),
    "clock": ("--fault", "clock_jump@20+4:step=-0.5"),
    "IMU lost": ("--fault", "imu_dropout@20+0.5"),
    "IMU stamps": ("--fault", "imu_stamps@15+20"),
    "IMU bias": ("--fault", "imu_bias@15+20"),
    "encoder": ("--fault", "encoder_stuck@18+5"),
    "magnet": ("--fault", "magnet_weak@carry"),
    "motor": ("--fault", "motor_loss@22:remaining=0.3"),
    "wind": ("--fault", "wind_gust@15+10"),
    "link cut": ("--fault", "mavlink_cut@20+1.5"),
    "link late": ("--fault", "mavlink_delay@20+5"),
}
MODULES = {"uam_lab": "uam_lab.cli.main", "uam_sim_bridge": "uam_sim_bridge.cli.main"}


class NoRecording(RuntimeError):
    """A flight wrote no recording; the text is one line with the end of its output."""


def recording_hash(file: Path) -> str:
    """SHA-256 over all columns of a timeseries.parquet, names included, in order of the names."""
    table = parquet.read_table(file)
    digest = hashlib.sha256()
    for name in sorted(table.column_names):
        digest.update(name.encode())
        column = table.column(name).combine_chunks()
        is_number = str(column.type) in ("double", "float", "bool", "int64")
        values = column.to_numpy(zero_copy_only=False).tobytes() if is_number else None
        digest.update(values or repr(column.to_pylist()).encode())
    return digest.hexdigest()[:16]


def fly(tree: Path, engine: str, seed: int, options: list[str], out: Path) -> str:
    """Fly with the code of `tree`; return the hash of its recording. Raises NoRecording."""
    module = next(name for package, name in MODULES.items() if (tree / package / "cli").is_dir())
    command = [sys.executable, "-c", RUN.format(module=module), "fly", "--no-report"]
    command += ["--engine", "ros", "--fused"] if engine == "fused" else ["--engine", engine]
    command += ["--seed", str(seed), *options, "--out", str(out)]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
    file = out / "timeseries.parquet"
    if not file.is_file():
        last = (done.stdout + done.stderr).strip().splitlines()[-1:]
        raise NoRecording(f"{engine}, seed {seed}, {tree.name}: no recording; {''.join(last)}")
    return recording_hash(file)


def main() -> int:
    """Fly, compare, print; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("revision", help="git revision to compare with")
    engines, names = ("direct", "ros", "fused"), ("all", *FLIGHTS)
    parser.add_argument("--engines", nargs="+", default=["direct", "ros"], choices=engines)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 7])
    parser.add_argument("--flights", nargs="+", default=["paper"], choices=names)
    options, options.further = parser.parse_known_args()
    git = ["git", "-C", str(HERE), "worktree"]
    with tempfile.TemporaryDirectory(prefix="same-flights-") as folder:
        other = Path(folder) / "other"
        made = subprocess.run(
            [*git, "add", "--detach", str(other), options.revision], capture_output=True, text=True
        )
        if made.returncode:
            print(f"same_flights: {made.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            return 2
        try:
            return compare(other, Path(folder), options)
        except NoRecording as error:
            print(f"same_flights: {error}", file=sys.stderr)
            return 2
        finally:
            subprocess.run([*git, "remove", "--force", str(other)], capture_output=True)


def compare(other: Path, folder: Path, options: argparse.Namespace) -> int:
    """Fly every engine and seed with both trees; return 0 where all recordings are equal."""
    print(f"| engine | flight | seed | {options.revision} | here | |\n|---|---|---|---|---|---|")
    names, different = list(FLIGHTS) if "all" in options.flights else options.flights, 0
    for engine, name, seed in product(options.engines, names, options.seeds):
        flight = engine, seed, [*FLIGHTS[name], *options.further]
        there = fly(other, *flight, folder / f"there-{engine}-{name}-{seed}")
        here = fly(HERE, *flight, folder / f"here-{engine}-{name}-{seed}")
        verdict = "equal" if there == here else "DIFFERENT"
        different += there != here
        print(f"| {engine} | {name} | {seed} | {there} | {here} | {verdict} |", flush=True)
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
