"""The mutants of a module: its source with one small error each, made by cosmic-ray's operators."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code

# what declares a parameter: default, description, unit, range
DECLARATIONS = {"number", "vector", "choice", "switch"}


@dataclass(frozen=True)
class Mutant:
    """One error: `line` of the source (stripped) has become `becomes`; source: the whole module."""

    line: str
    becomes: str
    number: int
    operator: str
    source: str

    @property
    def key(self) -> tuple[str, str]:
        """What stays the same where lines move."""
        return self.line, self.becomes


def mutants(source: str, operators: list[str]) -> Iterator[Mutant]:
    """Yield the mutants of a module; operators: regular expressions of cosmic-ray's names.

    Left out: annotations, decorators, declarations of parameters and examples of `prepared`, see
    `not_code`. Nothing of them is executed at a tick.
    """
    skipped = not_code(source)
    nodes = list(ast_nodes(get_ast(source)))
    seen = {source}
    for name in sorted(cosmic_ray.plugins.operator_names()):
        if not any(re.fullmatch(pattern, name) for pattern in operators):
            continue
        operator = cosmic_ray.plugins.get_operator(name)()
        places = [place for node in nodes for place in operator.mutation_positions(node)]
        for occurrence, (start, _) in enumerate(places):
            if any(begin <= start < end for begin, end in skipped):
                continue
            mutated = mutate_code(source, operator, occurrence)
            if mutated is None or mutated in seen:
                continue
            seen.add(mutated)
            yield _mutant(source, mutated, start[0], name)


def not_code(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return begin and end (line, column) of annotations, decorators, declared parameters, and of
    the calls of `prepared`, whose arguments are examples."""
    found: list[ast.expr] = []
    for node in ast.walk(ast.parse(source)):
        found += getattr(node, "decorator_list", [])
        found += [
            part
            for part in (getattr(node, "annotation", None), getattr(node, "returns", None))
            if part is not None
        ]
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "prepared":
            found.append(node)
        if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Call):
            function = node.value.func
            if isinstance(function, ast.Name) and function.id in DECLARATIONS:
                found.append(node.value)
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in found]


def _mutant(source: str, mutated: str, number: int, operator: str) -> Mutant:
    before, after = source.splitlines(), mutated.splitlines()
    first = next(
        (i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b), number - 1
    )
    short = operator.removeprefix("core/")
    return Mutant(_tidy(before[first]), _tidy(after[first]), first + 1, short, mutated)


def _tidy(line: str) -> str:
    """The line without its comment, and without the spaces that cosmic-ray puts before a number."""
    line = re.sub(r"\s+", " ", line.strip().partition("  # ")[0])
    return re.sub(r"(?<=[\[(:]) (?=-?\d)|(?<=[(:,] -) (?=\d)|(?<=[(:]-) (?=\d)", "", line)
