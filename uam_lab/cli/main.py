"""The command `uam`: one module of this package per subcommand."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from uam_lab.cli.command import INTERRUPTED, USER_ERRORS, WRONG_USE

# Subcommands and their modules; each module has add(subparsers), which sets `run`: arguments → exit
# status. Only the module of the chosen command is imported: all of them take seconds.
OPERATE = ("start", "hold", "resume", "land", "disarm", "kill", "goto", "status", "preflight")
COMMANDS = {
    "fly": "fly",
    "rehearse": "rehearse",
    **dict.fromkeys(OPERATE, "operate"),
    "checklist": "checklist",
    "view": "view",
    "profile": "profile",
    "report": "report",
    "compare": "compare",
    "tune": "tune",
    "campaign": "campaign",
    "faults": "faults",
    "margins": "margins",
    "budget": "budget",
    "vehicle": "vehicle",
    "arm": "arm",
    "identify-joint": "identify_joint",
    "doctor": "doctor",
    "calibrate-mocap": "calibrate_mocap",
}


class OneLineParser(argparse.ArgumentParser):
    """Parser that reports an error in one line, without the usage."""

    def error(self, message: str) -> None:
        """Print the line and exit with status 2."""
        self.exit(WRONG_USE, f"{self.prog}: {message} (see {self.prog} --help)\n")


def parser(command: str = "") -> argparse.ArgumentParser:
    """Return the parser of `uam`, with the module of this subcommand; with all if there is none."""
    top = OneLineParser(
        prog="uam",
        description="Flight control for aerial manipulators, and flights of it in simulation.",
        epilog="uam <command> --help explains a command.",
    )
    commands = top.add_subparsers(dest="command", metavar="<command>", required=True)
    modules = [COMMANDS[command]] if command in COMMANDS else dict.fromkeys(COMMANDS.values())
    for module in modules:
        importlib.import_module(f"uam_lab.cli.{module}").add(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    given = sys.argv[1:] if arguments is None else arguments
    options, unknown = parser(*given[:1]).parse_known_args(given)
    if unknown:
        said = f"unrecognized arguments: {' '.join(unknown)}"
        print(f"uam {options.command}: {said} (see uam {options.command} --help)", file=sys.stderr)
        return WRONG_USE
    try:
        return options.run(options)
    except KeyboardInterrupt:
        print(f"uam {options.command}: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output has ended, as in `uam fly | head`
        return 1
    except (*USER_ERRORS, OSError) as error:
        print(f"uam {options.command}: {error}", file=sys.stderr)
        return WRONG_USE


if __name__ == "__main__":
    sys.exit(main())
