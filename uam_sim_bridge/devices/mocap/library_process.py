"""Process of `LibrarySource`: prints one line of JSON per frame of the package `motioncapture`.

[arrival in ns, {"body": [x, y, z, qw, qx, qy, qz], ...}]
"""

import json
import os
import sys
import time


def main() -> int:
    """Print frames until the output is closed; arguments: kind of system, its options in JSON."""
    import motioncapture

    system, options = sys.argv[1:3]
    # the library prints on standard output itself
    lines = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1, encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        connection = motioncapture.connect(system, json.loads(options))
        while True:
            connection.waitForNextFrame()
            arrival = time.time_ns()
            bodies = {
                name: [*map(float, body.position), q.w, q.x, q.y, q.z]
                for name, body in connection.rigidBodies.items()
                for q in [body.rotation]
            }
            print(json.dumps([arrival, bodies]), file=lines)
    except (RuntimeError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
