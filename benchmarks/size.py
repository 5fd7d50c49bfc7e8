"""Files and lines of the product code at revisions: python benchmarks/size.py 4ee583d HEAD

Code: lines without docstrings, comments, imports and blank lines.
"""

from __future__ import annotations

import argparse
import ast
import subprocess

PACKAGES = ("uam_control", "uam_msgs_py", "uam_sim_bridge", "uam_lab")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def git(*arguments: str) -> str:
    """Return the output of a git command."""
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout


def code_lines(text: str) -> int:
    """Return the number of lines of code in a file."""
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            left_out.update(range(node.lineno, node.end_lineno + 1))
        elif isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None:
            left_out.update(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    lines = enumerate(text.splitlines(), start=1)
    return sum(
        number not in left_out and bool(line.strip()) and not line.lstrip().startswith("#")
        for number, line in lines
    )


def count(revision: str, package: str) -> tuple[int, int, int]:
    """Return files, lines and lines of code of a package."""
    names = git("ls-tree", "-r", "--name-only", revision, "--", package).splitlines()
    texts = [git("show", f"{revision}:{name}") for name in names if name.endswith(".py")]
    return len(texts), sum(t.count("\n") for t in texts), sum(map(code_lines, texts))


def main() -> None:
    """Print one table per revision."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("revisions", nargs="+", metavar="REVISION")
    for revision in parser.parse_args().revisions:
        rows = {package: count(revision, package) for package in PACKAGES}
        rows["all"] = tuple(map(sum, zip(*rows.values(), strict=True)))
        print(f"{revision:<16} {'files':>6} {'lines':>7} {'code':>7}")
        for name, row in rows.items():
            print(f"{name:<16} {row[0]:>6} {row[1]:>7} {row[2]:>7}")


if __name__ == "__main__":
    main()
