"""Checks of ROS: installation, messages between two processes, receive buffers.

The two processes are `python -m uam_lab.preflight.doctor.ros answer` and `ask`. They use two topics
in the ROS domain of their environment.
"""

import importlib.util
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from uam_lab.flights.processes.node_environment import PROFILES_FILE, ros_environment
from uam_lab.preflight.doctor.check_process import CheckProcess, Said, say
from uam_lab.preflight.doctor.finding import Finding, fail, ok, warn
from uam_sim_bridge.ports import LAST_DOMAIN, PortError, Reservation

MODULE = "uam_lab.preflight.doctor.ros"
THERE, BACK = "/uam/doctor/there", "/uam/doctor/back"
COUNT = 50  # messages
DISCOVERY, ANSWER = 15.0, 2.0  # [s] longest waits
PATIENCE = 40.0  # [s] for both processes: import, discovery, messages
REQUIRED, REQUIRED_RMW = "jazzy", "rmw_fastrtps_cpp"
SLOW = 0.05  # [s] round trip; above it control at 250 Hz in real time is not possible
RECEIVE_LIMIT = Path("/proc/sys/net/core/rmem_max")
ROOM = 4 * 2**20  # [bytes]: buffer size in config/dds/fastdds.xml
INSTALL = "make setup installs the wheels (x86-64); otherwise source /opt/ros/jazzy/setup.bash"
NAME = "environment"
BY_HAND = "uam fly sets its own domain; nodes started by hand"


def checks(surroundings: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    spec = importlib.util.find_spec("rclpy")
    if spec is None or spec.origin is None:
        yield fail("rclpy", "not installed: only --engine direct works", INSTALL)
        return
    yield from variables(surroundings)
    yield room()
    try:
        with Reservation() as reservation:
            said = measure(reservation.ports.domain)
            yield installation(Path(spec.origin), said, surroundings)
            yield round_trip(said, reservation.ports.domain)
    except PortError as error:
        yield warn("round trip", f"not tested: {error}", "end another flight and try again")


def measure(domain: int) -> Said:
    """Exchange messages between two processes in `domain`; return the output of the asking one."""
    with tempfile.TemporaryDirectory(prefix="uam-doctor-") as logs:
        own = ros_environment(domain, Path(logs))
        with CheckProcess(MODULE, ["answer"], own), CheckProcess(MODULE, ["ask"], own) as asking:
            return asking.wait(PATIENCE)


def installation(origin: Path, said: Said, surroundings: Mapping[str, str]) -> Finding:
    """Check version and middleware of rclpy; origin: its file."""
    if "file" not in said.facts:
        return fail("rclpy", f"{origin.parent} cannot be imported: {said.problem}", INSTALL)
    kind, rmw = kind_of(origin), said.facts["rmw"]
    found = f"{kind}, {rmw}, {origin.parent}"
    distribution = surroundings.get("ROS_DISTRO", "")
    if distribution and distribution != REQUIRED:
        return warn(
            "rclpy",
            f"{found}; ROS_DISTRO is {distribution}",
            f"the stack requires ROS 2 {REQUIRED}: source that one",
        )
    if distribution and kind == "wheels":
        return warn(
            "rclpy",
            f"{found}, and another installation is sourced ({distribution})",
            "use only one: a shell without the sourced one, or a venv without wheels",
        )
    if rmw != REQUIRED_RMW:
        return warn(
            "rclpy",
            found,
            f"config/dds is for {REQUIRED_RMW} only: with another one check "
            "the report for lost messages",
        )
    return ok("rclpy", found)


def kind_of(origin: Path) -> str:
    """Return the kind of an rclpy installation, by its file."""
    parts = origin.parts
    if parts[:3] == ("/", "opt", "ros"):
        return f"apt, ROS 2 {parts[3]}"
    if "site-packages" in parts and any(origin.parents[1].glob("ros_jazzy_rclpy-*.dist-info")):
        return "wheels"
    return "a workspace"


def round_trip(said: Said, domain: int) -> Finding:
    """Return the finding about the exchange of messages."""
    if "median_s" not in said.facts:
        return fail(
            "round trip",
            f"domain {domain}: {said.problem or 'no messages'}",
            "check the variables above, then firewall and container",
        )
    median, longest = (1e3 * said.facts[name] for name in ("median_s", "longest_s"))
    found = (
        f"two processes in domain {domain}: found in {said.facts['discovery_s']:.1f} s, "
        f"there and back {median:.1f} ms (median), {longest:.1f} ms (longest of 50)"
    )
    if median > 1e3 * SLOW:
        return warn("round trip", found, "the machine is busy or slow: fly --clock lockstep")
    return ok("round trip", found)


class Variable(NamedTuple):
    """What a variable's value means. fine: whether it is no problem; good, bad: text after it."""

    bad: str
    advice: str  # {}: name of the variable
    fine: Callable[[str], bool] = lambda value: False
    good: str = ""


VARIABLES = {
    "ROS_DOMAIN_ID": Variable(
        f" is not in 0..{LAST_DOMAIN}",
        f"{BY_HAND} fail with it: unset {{}}",
        lambda value: value.isascii() and value.isdecimal() and int(value) <= LAST_DOMAIN,
        f": {BY_HAND} use it",
    ),
    "RMW_IMPLEMENTATION": Variable(
        ": the stack is tested with rmw_fastrtps_cpp, and config/dds is for that one",
        "unset {}",
        lambda value: value == "rmw_fastrtps_cpp",
    ),
    PROFILES_FILE: Variable(
        " replaces config/dds/fastdds.xml: smaller buffers lose messages",
        "unset {}, unless it is intended",
    ),
    "ROS_LOCALHOST_ONLY": Variable(
        " is deprecated and overrides ROS_AUTOMATIC_DISCOVERY_RANGE: no other computer is found",
        "no effect on uam fly; for a vehicle: unset {}",
        lambda value: value == "0",
    ),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": Variable(
        f": {BY_HAND} find no other node",
        "unset {}",
        lambda value: value in ("SUBNET", "LOCALHOST", "SYSTEM_DEFAULT"),
        f": {BY_HAND} use it",
    ),
    "ROS_DISCOVERY_SERVER": Variable(
        ": nodes started by hand use only that server for discovery; uam fly does not use it",
        "unset {}, or start the server",
    ),
    "ROS_SECURITY_ENABLE": Variable(
        ": every node needs a key store and an enclave, those of uam fly too",
        "docs/interfaces.md, or unset {}",
        lambda value: value != "true",  # as rcl reads it
        ": security is off",
    ),
    "ROS_SECURITY_STRATEGY": Variable(
        ": with ROS_SECURITY_ENABLE=true no node starts without an enclave",
        "docs/interfaces.md, or unset {}",
        lambda value: value != "Enforce",
    ),
    "ROS_SECURITY_KEYSTORE": Variable(
        " has no folder enclaves: with ROS_SECURITY_ENABLE=true nodes find no keys",
        "ros2 security create_keystore, see docs/interfaces.md, or unset {}",
        lambda value: (Path(value) / "enclaves").is_dir(),
    ),
    "FASTDDS_BUILTIN_TRANSPORTS": Variable(
        " changes the transport of messages", "unset {}, unless it is intended"
    ),
}


def variables(surroundings: Mapping[str, str]) -> Iterator[Finding]:
    """Yield one finding per set variable, or one for all if none is set."""
    present = [name for name in VARIABLES if surroundings.get(name)]
    if not present:
        yield ok(NAME, f"none set of {', '.join(VARIABLES)}")
    for name in present:
        value, variable = surroundings[name], VARIABLES[name]
        text, advice = f"{name}={value}", variable.advice.format(name)
        if name == PROFILES_FILE and not Path(value).is_file():
            yield fail(NAME, f"{text} is no file", f"unset {name}")
        elif variable.fine(value):
            yield ok(NAME, text + variable.good)
        else:
            yield warn(NAME, text + variable.bad, advice)


def room(file: Path = RECEIVE_LIMIT) -> Finding:
    """Check the system's limit of a socket's receive buffer."""
    try:
        limit = int(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return ok("buffers", f"limit unknown: {file} is not readable")
    found = f"net.core.rmem_max is {limit // 1024} KiB"
    if limit < ROOM:
        return warn(
            "buffers",
            f"{found}: a process without processor time for tens of milliseconds loses messages",
            f"sudo sysctl -w net.core.rmem_max={ROOM}",
        )
    return ok("buffers", found)


def main() -> int:
    """In a child: answer, or ask and print the facts as lines of JSON; return the exit status.

    file, rmw: file and middleware of rclpy; discovery_s; median_s, longest_s: of a message there
    and back.
    """
    try:
        import rclpy
        from std_msgs.msg import Float64
    except Exception as error:  # a broken library may raise anything
        print(f"{type(error).__name__}: {error}".splitlines()[0])
        return 1
    say(file=rclpy.__file__, rmw=rclpy.get_rmw_implementation_identifier())
    rclpy.init()
    node = rclpy.create_node(f"uam_doctor_{sys.argv[1]}")
    if sys.argv[1] == "answer":
        back = node.create_publisher(Float64, BACK, 10)
        node.create_subscription(Float64, THERE, back.publish, 10)
        rclpy.spin(node)
        return 0
    heard: list[float] = []
    there = node.create_publisher(Float64, THERE, 10)
    node.create_subscription(Float64, BACK, lambda message: heard.append(message.data), 10)

    def until_heard(value: float, patience: float) -> bool:
        end = time.monotonic() + patience
        while value not in heard and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.05)
        return value in heard

    begun = time.monotonic()
    while not until_heard(-1.0, 0.1):  # repeated until the discovery is complete
        there.publish(Float64(data=-1.0))
        if time.monotonic() - begun > DISCOVERY:
            print(f"the two processes did not find each other within {DISCOVERY:g} s")
            return 1
    say(discovery_s=time.monotonic() - begun)
    times = []
    for number in range(COUNT):
        sent = time.perf_counter()
        there.publish(Float64(data=float(number)))
        if not until_heard(float(number), ANSWER):
            print(f"message {number} of {COUNT} did not come back within {ANSWER:g} s")
            return 1
        times.append(time.perf_counter() - sent)
    say(median_s=statistics.median(times), longest_s=max(times))
    return 0


if __name__ == "__main__":
    sys.exit(main())
