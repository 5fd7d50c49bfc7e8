"""Search for the files of config/ in every kind of installation.

| installation | location of config/ |
|---|---|
| checkout, `pip install -e .`, `colcon build --symlink-install` | config/ beside the packages |
| wheel, `colcon build` | share/uam/config under the installation prefix |
"""

from functools import cache
from pathlib import Path

SUFFIXES = (".yaml", ".xml", ".csv")


class ConfigurationError(ValueError):
    """A configuration file does not exist or is not valid; the text is one line."""


@cache
def root() -> Path:
    """Return the directory of profiles/, scenarios/ ...; raises ConfigurationError without one."""
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
    """Return the file or directory `relative` of config/, for example "profiles/s500.yaml".

    Raises ConfigurationError, with the list of existing files, if it does not exist.
    """
    found = root() / relative
    if found.exists():
        return found
    folder = found.parent if found.parent.is_dir() else root()
    existing = ", ".join(sorted(p.name for p in folder.iterdir())) or "nothing"
    raise ConfigurationError(f"no {relative} in the configuration; {folder.name}/ has: {existing}")


def named(folder: str, name: str, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """Return the file `name`, or the file of config/<folder> with this name without its suffix.

    `named("profiles", "s500")` and `named("profiles", "./mine.yaml")` both work. A name with a
    directory or a known suffix is a file. suffixes: of the accepted files in config/<folder>.
    Raises ConfigurationError, with the list of names, if there is no such file.
    """
    given = Path(name).expanduser()
    if given.is_file():
        return given
    kind = folder.rstrip("s")
    if given.suffix.lower() in SUFFIXES or len(given.parts) > 1:
        what = "is no file" if given.exists() else "does not exist"
        raise ConfigurationError(f"{kind} file {name} {what}")
    for suffix in suffixes:
        found = root() / folder / (name + suffix)
        if found.is_file():
            return found
    known = ", ".join(names(folder, suffixes)) or "none"
    raise ConfigurationError(f"unknown {kind} '{name}'; there are: {known}, or give a file")


def beside(file: Path, folder: str, name: str) -> str:
    """Return the name of config/<folder>, or file relative to the folder of `file`, in `file`.

    Raises ConfigurationError, with `file`, for a name or a file that does not exist.
    """
    near = file.parent / Path(name).expanduser()
    own = near.is_file() or near.suffix.lower() in SUFFIXES or len(Path(name).parts) > 1
    try:
        found = named(folder, str(near.absolute()) if own else name)
    except ConfigurationError as error:
        raise ConfigurationError(f"{file}: {error}") from None
    return str(found) if own else name


def names(folder: str, suffixes: tuple[str, ...] = SUFFIXES) -> list[str]:
    """Return the names that `named` accepts for config/<folder>, sorted."""
    return sorted({p.stem for p in (root() / folder).glob("*") if p.suffix in suffixes})
