"""What the commands share: parser, types of options."""

from __future__ import annotations

import argparse
import math
import os
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from uam_control.laws import catalogue
from uam_control.profiles.profile import Profile, default_profile, load_profile
from uam_control.settings import configuration
from uam_control.settings.parameter_set import Bound, Choice, ParameterSet, Switch, Text
from uam_control.vehicle import DEFAULT_VEHICLE, VehicleDescription
from uam_lab.experiments.workers.place import Workplace, cores
from uam_lab.flights.flight_options import LAST_SEED
from uam_lab.flights.flight_settings import SettingsError, require_ros
from uam_lab.flights.vehicle.lab_file import FOLDER, TEMPLATE
from uam_msgs_py.node.namespace import normal
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.catalogue import EFFECTS
from uam_sim_bridge.plant.effects.presets import CALM, Effects
from uam_sim_bridge.ports import INSTANCES, flight_of

if TYPE_CHECKING:
    from uam_lab.flights.processes.guest import Guest

Subcommands = Any  # what `add_subparsers` returns: argparse has no public name for it
WRONG_USE = 2  # exit status


class Command:
    """The parser of a subcommand; its methods add options, with the default in the help."""

    def __init__(self, commands: Subcommands, name: str, module: ModuleType) -> None:
        """module: of this package, with `add`, which adds its options to a command, and `run`:
        options → exit status. Its docstring, or `page(name)`: `uam <name>`: summary, description,
        examples, with an empty line between."""
        page = module.page(name) if hasattr(module, "page") else module.__doc__
        head, description, examples = page.split("\n\n", 2)
        summary = head.removesuffix(".").partition("`: ")[2]
        self.name = name
        parser = commands.add_parser(
            name,
            help=summary,
            description=description,
            epilog=examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.set_defaults(run=module.run)
        self._add, self._parser = parser.add_argument, parser
        module.add(self)

    def subcommands(self, **modules: ModuleType) -> None:
        """Add commands below this one, which runs without them, too."""
        text = "in place of this one; each has --help"
        below = self._parser.add_subparsers(metavar="<command>", title="further", help=text)
        for name, module in modules.items():
            Command(below, name, module)

    def option(
        self, flag: str, metavar: str | tuple[str, ...], text: str, default: Any = None, **how: Any
    ) -> None:
        """Add an option with a value, or an argument: a flag without dashes."""
        if default not in (None, ""):
            text = f"{text} (default %(default)s)".strip()
        self._add(flag, metavar=metavar, help=text, default=default, **how)

    def repeated(self, flag: str, metavar: str, text: str, **how: Any) -> None:
        """Add an option that may be given several times; its value is a list."""
        text = f"{text}; may be repeated"
        self._add(flag, metavar=metavar, help=text, action="append", default=[], **how)

    def switch(self, flag: str, text: str) -> None:
        """Add an option without a value; --no-video is `video`, which is true without it."""
        on = flag.removeprefix("--no-")
        how = {"action": "store_true"} if on == flag else {"action": "store_false", "dest": on}
        self._add(flag, help=text, **how)

    def choice(self, flag: str, choices: tuple[str, ...], default: str, text: str) -> None:
        """Add an option whose value is one of `choices`."""
        self.option(flag, "|".join(choices), text, default, choices=choices)

    def described(self, kind: type[ParameterSet], names: str, **metavars: str) -> None:
        """Add options for parameters of a set; names: of the parameters, in order.

        metavars: parameter → its unit in other words. A list of texts is an option that may be
        repeated, in the singular.
        """
        default = kind()
        for name in names.split():
            spec = kind.specs()[name]
            usual = getattr(default, name)
            flag = f"--{name.removesuffix('_deg').replace('_', '-')}"
            if isinstance(spec, Switch):
                self.switch(flag, spec.description)
            elif isinstance(spec, Text) and spec.several:
                flag = flag.removesuffix("s")
                self.repeated(flag, spec.allowed, spec.description, dest=name)
            elif isinstance(spec, Bound):
                what = number(name.replace("_", " "), spec.unit, spec.low, spec.high)
                metavar = metavars.get(name, spec.unit.upper().replace("^", "") or "N")
                kind_of = int if spec.whole else what
                self.option(flag, metavar, spec.description, usual, type=kind_of, dest=name)
            else:
                words = "|".join(spec.choices) if isinstance(spec, Choice) else spec.allowed
                self.option(flag, metavars.get(name, words), spec.description, usual)

    def vehicle(self, others: str = "") -> None:
        """Add --vehicle; others: who else names one, "the lab file's", None is the default then."""
        vehicles = ", ".join(configuration.names("vehicle", (".yaml",)))
        text = f"{vehicles}, or the description of one: docs/your_vehicle.md"
        if others:
            text += f" (default: {others}, {DEFAULT_VEHICLE} without)"
        self.option("--vehicle", "NAME|FILE", text, None if others else DEFAULT_VEHICLE)

    def config(self, default: str | None = None) -> None:
        """Add --config, the lab file."""
        files = ", ".join(configuration.names(FOLDER, (".yaml",)))
        text = f"lab file: {files}, or a file of yours, from uam vehicle --example"
        self.option("--config", "NAME|FILE", text, default)

    def arm_hardware(self) -> None:
        """Add --config, --device and --answer-timeout, of an arm."""
        self.config(TEMPLATE)
        self.option("--device", "PATH", "serial device in place of the lab file's", "")
        text = "longest wait for an answer of a servo"
        wait = number("time", "s", 0.0005, 5.0)
        self.option("--answer-timeout", "S", text, 0.05, type=wait)

    def scenario(self) -> None:
        text = f"{', '.join(configuration.names('scenarios'))}, or a .yaml or .csv file"
        self.option("--scenario", "NAME|FILE", text, "pick_and_place")

    def profile(self) -> None:
        """Add --profile, for `given_profile`."""
        text = "a later one overrides (default: the vehicle's)"
        self.repeated("--profile", "NAME|FILE", text)

    def plant(self) -> None:
        """Add --plant-preset and --effect."""
        known = ", ".join(configuration.names("plant"))
        text = (
            f"effects of the plant: {known}, or a file; a later one overrides (default {CALM}); "
            "docs/plant.md"
        )
        self.repeated("--plant-preset", "NAME|FILE", text)
        text = (
            "one effect of the plant: NAME (as in laboratory), NAME=off, or "
            f"NAME:parameter=value,...; there are: {', '.join(EFFECTS)}"
        )
        self.repeated("--effect", "SPEC", text, dest="effects")

    def seed(self, what: str) -> None:
        self.option("--seed", "N", what, 1, type=seed)

    def workers(self, with_ros: bool = False) -> None:
        """Add --jobs and --scheduler; with_ros: the command has --engine. See `place_of`."""
        more = "; with --engine ros one flight at a time" if with_ros else ""
        text = f"worker processes of this machine (default: one per core, {cores()}{more})"
        self.option("--jobs", "N", text, type=count)
        text = (
            "Dask scheduler whose workers fly, as tcp://host:8786, in place of processes of this "
            "machine: docs/experiments.md"
        )
        self.option("--scheduler", "ADDRESS", text, "")

    def process(self) -> None:
        """Add the options of the processes of the nodes that fly, for `chosen_process`."""
        text = (
            "real-time priority of the nodes that fly; in lockstep also of plant and autopilot: "
            "SCHED_FIFO 1..98 (default: ordinary)"
        )
        self.option("--fifo", "PRIORITY", text, type=int, dest="fifo_priority")
        text = "nice value of the nodes that fly, -20..19 (default: 0)"
        self.option("--nice", "N", text, type=int)
        self.option("--cores", "LIST", "cores of the nodes that fly, as 1,3 or 2-3 (default: all)")
        text = "keep the memory of the nodes that fly from being swapped out"
        self.switch("--lock-memory", text)
        text = "time after a tick in which these nodes look for the next input without sleeping"
        self.option("--busy-poll", "MS", text, type=number("time", "ms", 0.0, 100.0))

    def out(self, folder: str = "") -> None:
        """Add --out; folder: name of the default folder without the time."""
        text = f"result folder (default results/<time>-{folder or self.name})"
        self.option("--out", "DIR", text, type=path)

    def instance(self) -> None:
        """Add --instance, of a running flight."""
        text = f"instance of the flight, 0..{INSTANCES - 1} (default: the running one)"
        self.option("--instance", "N", text, type=int)
        text = "namespace of its nodes (default: that of the running flight)"
        self.option("--namespace", "NAME", text, "")


def guest_of(options: argparse.Namespace) -> Guest:
    """Return a node in the flight that --instance and --namespace choose, for `with`.

    Raises as `chosen_flight`, RosRefused.
    """
    require_ros()
    from uam_lab.flights.processes.guest import Guest
    from uam_lab.flights.processes.node_environment import transport_environment

    domain, namespace = chosen_flight(options)
    environment = {} if domain is None else transport_environment()  # of uam fly, or the user's
    return Guest(f"uam_{options.command}", environment, domain, namespace)


def chosen_flight(options: argparse.Namespace) -> tuple[int | None, str]:
    """Return ROS domain and namespace of the flight that --instance and --namespace choose.

    Without --instance the flight must be in the domain ROS_DOMAIN_ID, if the user has set it: the
    nodes there may be those of another vehicle. The domain is None without a running flight: that
    of the environment. Raises SettingsError, PortError.
    """
    try:
        namespace = normal(options.namespace) if options.namespace else ""
    except ValueError as error:
        raise SettingsError(str(error)) from None
    given = os.environ.get("ROS_DOMAIN_ID", "")
    domain = int(given) if given.isdecimal() else None
    flight = flight_of(options.instance, namespace, domain=domain)
    if flight is None:
        return None, namespace or "/"
    return flight.domain, namespace or flight.namespace


def given_profile(names_or_files: Sequence[str], vehicle: VehicleDescription) -> Profile:
    """Return the profile of --profile, merged; of none: the vehicle's for the default law.

    Raises ConfigurationError, ProfileError.
    """
    if not names_or_files:
        return default_profile(catalogue.DEFAULT, vehicle)
    files = (str(configuration.named("profiles", one)) for one in names_or_files)
    return load_profile(*files, vehicle=vehicle)


def again(command: str, options: argparse.Namespace, **named: object) -> str:
    """Return a command of `uam` with the options `named`, as far as they are given, and with
    --profile, --plant-preset and --effect as here."""
    given = {
        **{f"--{name}": [str(value)] for name, value in named.items() if value is not None},
        "--profile": options.profile,
        "--plant-preset": options.plant_preset,
        "--effect": options.effects,
    }
    words = [word for flag, values in given.items() for one in values for word in (flag, one)]
    return shlex.join(["uam", command, *words])


def chosen_effects(options: argparse.Namespace) -> Effects:
    """Return the effects of the plant that --plant-preset and --effect choose.

    Raises PlantError, ConfigurationError.
    """
    return presets.read(options.plant_preset, options.effects)


def chosen_process(given: dict[str, Any]) -> dict[str, Any]:
    """Remove the options of `Command.process` from `given`; return them as parameters."""
    chosen = {name: given.pop(name) for name in ("fifo_priority", "nice", "cores", "lock_memory")}
    if (busy := given.pop("busy_poll")) is not None:
        chosen["busy_poll"] = 1e-3 * busy
    return {name: value for name, value in chosen.items() if value not in (None, False)}


def refuse_given(why: str, **options: Any) -> None:
    """Raise SettingsError for the options that have a value: name → value."""
    given = [f"--{name.replace('_', '-')}" for name, value in options.items() if value]
    if given:
        raise SettingsError(f"{', '.join(given)}: {why}")


def place_of(options: argparse.Namespace) -> Workplace:
    """Return where the work is done: --jobs or --scheduler.

    Raises SettingsError for both of them, or for several flights at once with --engine ros.
    """
    if options.scheduler and options.jobs:
        raise SettingsError("--jobs is for this machine: the scheduler's workers are those it has")
    engine = getattr(options, "engine", "direct")
    if engine != "direct" and (options.scheduler or (options.jobs or 1) > 1):
        raise SettingsError(f"--engine {engine} flies one flight at a time, on this machine")
    return Workplace(options.jobs or cores(), options.scheduler)


def count(text: str) -> int:
    """Return the whole number in `text`, 1 or more. A type for argparse, as the next two."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of 1 or more")
    return int(text)


def seed(text: str) -> int:
    """Return the seed in `text`."""
    if not text.isdecimal() or int(text) > LAST_SEED:
        raise argparse.ArgumentTypeError(
            f"'{text}' is not a seed: a whole number from 0 to {LAST_SEED}"
        )
    return int(text)


def path(text: str) -> Path:
    """Return a path, the type of an option; an empty name would be the present folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty")
    return Path(text)


def number(
    name: str, unit: str, low: float = -math.inf, high: float = math.inf
) -> Callable[[str], float]:
    """Return a type for argparse: a finite number from `low` to `high`."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not low <= value <= high:
            limits = [f", at least {low:g}"] * (low > -math.inf)
            limits += [f", at most {high:g}"] * (high < math.inf)
            of = f" in {unit}" if unit else ""
            raise argparse.ArgumentTypeError(
                f"'{text}' is not a {name}: a number{of}{''.join(limits)}"
            )
        return value

    return read
