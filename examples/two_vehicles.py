"""Two vehicles at once, each in its own ROS domain; one of them has to wait for the other.

python examples/two_vehicles.py [FOLDER]
"""

import asyncio
import sys
from pathlib import Path

from uam_lab import Flight
from uam_lab.records.results.result_folder import new_folder


async def leader(flight: Flight, in_the_air: asyncio.Event):
    """Fly the scenario; tell the other vehicle when the first phase in the air begins."""
    async with flight:
        await flight.wait_for_async("flying")
        in_the_air.set()
        return await flight.wait_async()


async def follower(flight: Flight, in_the_air: asyncio.Event):
    """Take off after the leader. Commands block, so they run in a thread."""
    async with flight:
        await in_the_air.wait()
        print("follower:", await asyncio.to_thread(flight.start))
        return await flight.wait_async()


async def main():
    """Fly both and print their errors."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else new_folder(Path("results"), "pair")
    scenario = sys.argv[2] if len(sys.argv) > 2 else "hover"
    in_the_air = asyncio.Event()
    first = Flight(scenario=scenario, seed=1, out=out / "leader")
    second = Flight(scenario=scenario, seed=2, out=out / "follower", auto_start=False)
    results = await asyncio.gather(leader(first, in_the_air), follower(second, in_the_air))
    print("domains", first.domain, second.domain)
    for result in results:
        print(result.folder.name, result.completed, result.metrics["rms"]["position_m"])


if __name__ == "__main__":
    asyncio.run(main())
