"""Finds the files of config/ in every kind of installation.

| installation | config/ is |
|---|---|
| checkout, `pip install -e .`, `colcon build --symlink-install` | config/ beside the packages |
| wheel, `colcon build` | share/uam/config under the installation prefix |
"""

from functools import cache
from pathlib import Path

SUFFIXES = (".yaml", ".xml", ".csv")


class ConfigurationError(ValueError):
    """A configuration file does not exist or is not what it should be; the text is one line."""


@cache
def root() -> Path:
    """The directory that holds profiles/, scenarios/, vehicle/ ...

    Raises ConfigurationError when the installation has none.
    """
    package = Path(__file__).resolve().parents[1]
    checkout = package.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / "config").is_dir():
        return checkout / "config"
    for prefix in package.parents:
        if (prefix / "share/uam/config").is_dir():
            return prefix / "share/uam/config"
    raise ConfigurationError(
        f"the configuration files are missing: no share/uam/config above {package}; "
        "install the project again (make setup)"
    )


def path(relative: str) -> Path:
    """The file or directory `relative` of config/, as "profiles/s500.yaml".

    Raises ConfigurationError listing what exists when there is no such file.
    """
    found = root() / relative
    if found.exists():
        return found
    folder = found.parent
    if not folder.is_dir():
        raise ConfigurationError(
            f"no {relative} in the configuration, which has the folders: "
            + ", ".join(sorted(p.name for p in root().iterdir() if p.is_dir()))
        )
    raise ConfigurationError(
        f"no {relative} in the configuration; {folder.relative_to(root())}/ has: "
        + (", ".join(sorted(p.name for p in folder.iterdir())) or "nothing")
    )


def named(folder: str, name: str, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """What the user calls `name`: a file of his own, or one of config/<folder> without its suffix.

    `named("profiles", "s500")` and `named("profiles", "./mine.yaml")` both work. A name with a
    directory or a known suffix is a file. suffixes: of the files that count. Raises
    ConfigurationError otherwise, listing the names.
    """
    given = Path(name).expanduser()
    if given.is_file():
        return given
    kind = folder.rstrip("s")
    if given.suffix in SUFFIXES or len(given.parts) > 1:
        raise ConfigurationError(f"{kind} file {name} does not exist")
    for suffix in suffixes:
        found = root() / folder / (name + suffix)
        if found.is_file():
            return found
    known = ", ".join(names(folder, suffixes)) or "none"
    raise ConfigurationError(f"unknown {kind} '{name}'; there are: {known}, or give a file")


def names(folder: str, suffixes: tuple[str, ...] = SUFFIXES) -> list[str]:
    """The names that `named` knows in config/<folder>, sorted."""
    return sorted(p.stem for p in (root() / folder).glob("*") if p.suffix in suffixes)
