"""Parser of the command `uam`: one module of this package per subcommand."""

import argparse
import errno
import importlib
import re
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from uam_control.settings.texts import visible
from uam_lab.cli import output
from uam_lab.cli.command import WRONG_USE, Command
from uam_lab.flights.processes.interrupts import INTERRUPTED
from uam_lab.records.results.terminal import say

NOT_WRITTEN = 1  # exit status
OURS = "uam_"  # packages whose errors have a text of one line for the user
LONGEST_ERROR = 2000  # [characters]
FULL = (errno.ENOSPC, errno.EDQUOT)

# Subcommands. Only the module of the chosen one is imported: all of them take seconds.
OPERATE = ("start", "hold", "resume", "land", "disarm", "kill", "goto", "status", "preflight")
COMMANDS = (
    *("fly", "rehearse", *OPERATE, "teleop", "checklist", "view", "profile", "report"),
    *("compare", "duel", "tune", "campaign", "faults", "margins", "budget"),
    *("vehicle", "arm", "hand", "identify-joint", "doctor", "calibrate-mocap"),
)


def module_of(command: str) -> ModuleType:
    """Return the module of a subcommand, see `Command`."""
    name = "operate" if command in OPERATE else command.replace("-", "_")
    return importlib.import_module(f"uam_lab.cli.{name}")


class OneLineParser(argparse.ArgumentParser):
    """Parser that reports an error in one line, without the usage."""

    def error(self, message: str) -> None:
        """Print the line and exit with status 2."""
        say(f"{self.prog}: {message} (see {self.prog} --help)", error=True)
        self.exit(WRONG_USE)


class _Version(argparse.Action):
    """Print the version, and the commit of a checkout, and end."""

    def __call__(self, top: argparse.ArgumentParser, *_: object) -> None:
        from uam_lab.records.results.result_folder import versions  # asks git

        found = versions()
        commit = found["git_commit"]
        say(f"uam {found['packages']['uam']}" + (f", commit {commit}" if commit else ""))
        top.exit()


def parser(command: str = "") -> argparse.ArgumentParser:
    """Return the parser of `uam`, with the module of this subcommand; with all if there is none."""
    top = OneLineParser(
        prog="uam",
        description="Flight control for aerial manipulators, and flights of it in simulation.",
        epilog="uam <command> --help explains a command.",
    )
    text = "print version and commit"
    top.add_argument("--version", action=_Version, nargs=0, dest=argparse.SUPPRESS, help=text)
    commands = top.add_subparsers(dest="command", metavar="<command>", required=True)
    for name in (command,) if command in COMMANDS else COMMANDS:
        Command(commands, name, module_of(name))
    return top


def parsed(given: Sequence[str]) -> argparse.Namespace:
    """Return the options of the words `given`; raises SystemExit for wrong ones."""
    top = parser(*given[:1])
    options, unknown = top.parse_known_args(_with_lists(given))
    if unknown:
        top.prog = f"{top.prog} {options.command}"
        top.error(f"unrecognized arguments: {' '.join(unknown)}")
    return options


def _with_lists(given: Sequence[str]) -> list[str]:
    """Return the words with --option=-1,2 for --option -1,2, which argparse takes for two."""
    words: list[str] = []
    for word in given:
        negative = re.match(r"-[.\d].*,", word) and words and words[-1].startswith("--")
        words[-1:] = [f"{words[-1]}={word}"] if negative else [*words[-1:], word]
    return words


def run(options: argparse.Namespace) -> int:
    """Run the chosen command; return the exit status."""
    try:
        status = options.run(options)
        if lost := output.reason():
            say(f"uam {options.command}: stdout: {lost}: lines are missing", error=True)
        return status or (NOT_WRITTEN if lost else 0)
    except BaseException as error:
        expected = isinstance(error, OSError) or type(error).__module__.startswith(OURS)
        if not expected:
            if (ended := _interrupted(error)) is None:
                raise
            say("; ".join([f"uam {options.command}: interrupted", *ended.args]), error=True)
            return INTERRUPTED
        if getattr(error, "errno", None) in FULL:
            say(f"uam {options.command}: {_full(error)}", error=True)
            return NOT_WRITTEN
        text = visible(error)  # a name in it may have a line end, a value any length
        more = f" … ({len(text)} characters)" if len(text) > LONGEST_ERROR else ""
        say(f"uam {options.command}: {text[:LONGEST_ERROR]}{more}", error=True)
        return WRONG_USE


def _interrupted(error: BaseException | None) -> KeyboardInterrupt | None:
    """Return the Ctrl-C behind an error: an import that it ends may fail in other words."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error


def _full(error: OSError) -> str:
    text = (error.strerror or str(error)).lower()
    if error.filename is None:
        return text
    file = Path(error.filename)
    return (
        f"{file.name} is not written, {text} in {file.absolute().parent}: the results there are "
        "incomplete, and a log may end early"
    )
