"""Progress of a long computation: a bar on a terminal, otherwise a few lines."""

from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from uam_lab.records.results.terminal import Terminal, say

LINES = 20  # largest number of lines if the output is no terminal


class Counting:
    """Context manager; call `show(done, text)` any number of times."""

    def __init__(self, what: str, total: int):
        self._what, self._total = what, total
        self._console = Terminal()
        self._said = 0
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[text]}", markup=False),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._line = self._bar.add_task(what, total=total, text="")

    def __enter__(self) -> Self:
        self._bar.__enter__()
        return self

    def __exit__(self, *exception) -> None:
        self._bar.__exit__(*exception)

    def show(self, done: int, text: str) -> None:
        """Show the number of finished items and a text about the newest one."""
        self._bar.update(self._line, completed=done, text=text)
        share = LINES * done // self._total
        if not self._console.is_terminal and share > self._said:
            self._said = share
            say(f"{self._what}: {done} of {self._total}, {text}")
