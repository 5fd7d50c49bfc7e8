"""The command `uam`: one module of this package per subcommand."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from uam_lab.cli import (
    campaign,
    compare,
    doctor,
    faults,
    fly,
    margins,
    operate,
    profile,
    report,
    tune,
    view,
)
from uam_lab.cli.command import INTERRUPTED, USER_ERRORS, WRONG_USE

# each has add(subparsers), which sets `run`: arguments → exit status
COMMANDS = (
    *(fly, operate, view, profile, report, compare, tune, campaign, faults, margins, doctor),
)


class OneLineParser(argparse.ArgumentParser):
    """Parser that reports an error in one line, without the usage."""

    def error(self, message: str) -> None:
        """Print the line and exit with status 2."""
        self.exit(WRONG_USE, f"{self.prog}: {message} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """Return the parser of `uam` with all subcommands."""
    top = OneLineParser(
        prog="uam",
        description="Flight control for aerial manipulators, and flights of it in simulation.",
        epilog="uam <command> --help explains a command.",
    )
    commands = top.add_subparsers(dest="command", metavar="<command>", required=True)
    for command in COMMANDS:
        command.add(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    options, unknown = parser().parse_known_args(arguments)
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
