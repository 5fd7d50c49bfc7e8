"""How a node runs inside a flight: it ends when the orchestrator ends, however that ends.

    python -m uam_sim_bridge.flight.child <niceness> <package.module> [arguments of the node...]

The orchestrator holds the other end of this process's standard input and never writes to it. When
the orchestrator is gone - even by `kill -9`, which no handler sees - the pipe reports its end; the
node is then interrupted as by Ctrl-C, and killed if that does not help. Unlike PR_SET_PDEATHSIG
this works on every system and lets the recorder close its file.
"""

import importlib
import os
import signal
import sys
import threading
import time

GRACE = 5.0  # seconds from the interrupt to the kill, once the orchestrator is gone


def _follow_the_orchestrator() -> None:
    while True:
        try:
            if not os.read(0, 1):
                break
        except InterruptedError:
            continue
        except OSError:
            break
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE)
    os.kill(os.getpid(), signal.SIGKILL)


def main() -> None:
    """Import the module and call its `main()`, which reads sys.argv."""
    niceness, module = int(sys.argv[1]), sys.argv[2]
    sys.argv = sys.argv[2:]
    os.nice(niceness)
    threading.Thread(target=_follow_the_orchestrator, daemon=True).start()
    sys.exit(importlib.import_module(module).main())


if __name__ == "__main__":
    main()
