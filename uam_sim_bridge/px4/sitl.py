"""Executable `px4_sitl`: PX4 in software as the autopilot of a flight.

It runs in a new directory, so that no parameter of an earlier flight remains. It uses the ports of
its instance (TCP 4560 + N of the simulator, UDP 14580 + N) and the parameters of config/. PX4's log
(ULog) is saved on request, also if PX4 ends early. PX4's clock is the simulator's: PX4 waits for
each HIL_SENSOR. PX4 never connects again after the simulator has hung up: this program then starts
it anew for the next simulator, until it is interrupted.

examples:
  px4_sitl --px4-dir ~/PX4-Autopilot/build/px4_sitl_default
  px4_sitl --instance 2 --log flight.ulg
  px4_sitl --params mine.yaml       NAME: value lines, PX4's names
  px4_sitl --param COM_OF_LOSS_T=1.0 --param SDLOG_MODE=0
"""

import argparse
import sys
import time
from collections.abc import Sequence
from functools import partial

import psutil

from uam_control.vehicle import load_description
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST, Program
from uam_sim_bridge.ports import SIMULATOR_TCP
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.process import How, Px4Process, add_px4_options, command
from uam_sim_bridge.px4.px4_installation import VARIABLE, Px4Installation, required

NAME = "px4_sitl"
HUNG_UP = "the simulator hung up; PX4 starts anew for the next one"
POLL, LOOK = 0.05, 0.5  # s between two looks at PX4, and at its connection


def until_over(px4: Px4Process, port: int | None) -> bool:
    """Wait until PX4 has ended (False), or its simulator at TCP `port` has hung up (True).

    port None: only until PX4 has ended.
    """
    met, look = False, 0.0
    while px4.process.poll() is None:
        time.sleep(POLL)
        if port is None or time.monotonic() < look:
            continue
        look = time.monotonic() + LOOK
        connected = _connected(px4.process.pid, port)
        if met and not connected:
            return True
        met = met or connected
    return False


def _connected(pid: int, port: int) -> bool:
    """Return whether a process has an open connection to a TCP port."""
    try:
        sockets = psutil.Process(pid).net_connections("tcp")
    except psutil.Error:
        return False
    return any(
        one.raddr and one.raddr.port == port and one.status == psutil.CONN_ESTABLISHED
        for one in sockets
    )


def parser() -> Program:
    p = Program(__doc__)
    p.instance()
    add_px4_options(p, required(VARIABLE))
    p.vehicle()
    p.option("--sim-host", "HOST", "simulator", HOST)
    p.switch("--once", "serve one simulator (default: start PX4 anew for the next one)")
    return p


def prepared(options: argparse.Namespace) -> How:
    """Return how PX4 runs, anew for each simulator. Raises what `command` reports."""
    installation = Px4Installation.find(options.px4_dir)
    vehicle = load_description(options.vehicle)
    given = parameters.load(vehicle, options.params, options.param, installation.ranges())
    values = parameters.motor_outputs(vehicle) | given
    scripts = {parameters.STARTED_LATE: parameters.start_script(values)}
    variables = parameters.environment(values) | {"PX4_SIM_HOSTNAME": options.sim_host}
    port = None if options.once else SIMULATOR_TCP + options.instance
    start = partial(Px4Process, installation, options.instance, scripts, variables)
    return How(start, options.log, lambda px4: until_over(px4, port), HUNG_UP)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run PX4 until interrupted; return the exit status, see `command`."""
    return command(NAME, parser().parse_args(arguments), prepared)


if __name__ == "__main__":
    sys.exit(main())
