"""What a flight is asked to be: the command line's options, checked, before anything starts."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from uam_control.mission import Scenario, load_scenario
from uam_control.profile import Profile, load_profile

CONTROLLERS = {"modular": "s500"}  # controller → its default profile
ANNOUNCED = ("asmc1", "asmc2")  # the paper's baselines, not there yet
ENGINES = ("ros", "direct")
CLOCKS = ("lockstep", "realtime")
PAYLOAD_MAX = 2.0  # [kg] more than the rotors could ever carry


class SettingsError(ValueError):
    """An option that cannot be flown; the text is one line: what was wrong, what is allowed."""


@dataclass(frozen=True)
class FlightSettings:
    """One flight. Scenario and profile are loaded, hence valid.

    payload_mass [kg]; vehicle_changes: dotted entries of config/vehicle/*.yaml to replace, as
    {"air.wind": [3.0, 0.0, 0.0]}; out: the result folder, which does not exist yet or is empty.
    """

    scenario: Scenario
    profile: Profile
    payload_mass: float
    out: Path
    controller: str = "modular"
    engine: str = "ros"
    clock: str = "lockstep"
    autopilot: str = "builtin"
    seed: int = 1
    video: bool = True
    scenario_source: str = ""  # what the user called it: a name or a file
    vehicle_changes: dict[str, object] = field(default_factory=dict)


def settings(
    scenario: str = "pick_and_place",
    controller: str = "modular",
    profile: str | None = None,
    engine: str = "ros",
    clock: str = "lockstep",
    autopilot: str = "builtin",
    payload_mass: float | None = None,
    seed: int = 1,
    out: str | Path | None = None,
    video: bool = True,
    vehicle_changes: dict[str, object] | None = None,
) -> FlightSettings:
    """Check the options and load what they name.

    Raises SettingsError, and what load_scenario and load_profile raise (ScenarioError,
    ProfileError); each is one line for the user.
    """
    if controller in ANNOUNCED:
        raise SettingsError(
            f"controller {controller} is not part of this version; there are: "
            + ", ".join(CONTROLLERS)
        )
    _choice("controller", controller, CONTROLLERS)
    _choice("engine", engine, ENGINES)
    _choice("clock", clock, CLOCKS)
    if engine == "direct" and clock == "realtime":
        raise SettingsError("the direct engine has no clock: --clock realtime needs --engine ros")
    if engine == "direct" and autopilot != "builtin":
        raise SettingsError("the direct engine has no sockets: --autopilot needs --engine ros")
    if not 0 <= seed < 2**31:
        raise SettingsError(f"seed {seed} is outside 0..{2**31 - 1}")
    loaded = load_scenario(scenario)
    mass = loaded.payload_mass if payload_mass is None else payload_mass
    if not 0.0 <= mass <= PAYLOAD_MAX:
        raise SettingsError(f"payload mass {mass:g} kg is outside 0..{PAYLOAD_MAX:g} kg")
    return FlightSettings(
        scenario=loaded,
        profile=load_profile(profile or CONTROLLERS[controller]),
        payload_mass=mass,
        out=result_folder(out, loaded.name, controller),
        controller=controller,
        engine=engine,
        clock=clock,
        autopilot=autopilot,
        seed=seed,
        video=video,
        scenario_source=scenario,
        vehicle_changes=dict(vehicle_changes or {}),
    )


def _choice(name: str, value: str, allowed) -> None:
    if value not in allowed:
        raise SettingsError(f"unknown {name} '{value}'; there are: {', '.join(allowed)}")


def result_folder(out: str | Path | None, scenario: str, controller: str) -> Path:
    """The folder a flight will write to; checked to be writable, but not made.

    Without `out`: results/<time>-<scenario>-<controller>, in the current directory. Raises
    SettingsError for a file, a folder that holds something already, or one that cannot be written.
    """
    if out is None:
        stamp = datetime.now().strftime("%Y-%m-%d-%H%M%S")
        folder = base = Path("results") / f"{stamp}-{scenario}-{controller}"
        count = 2
        while folder.exists():
            folder = base.with_name(f"{base.name}-{count}")
            count += 1
    else:
        folder = Path(out).expanduser()
    if folder.exists() and not folder.is_dir():
        raise SettingsError(f"result folder {folder} is a file")
    if folder.is_dir() and any(folder.iterdir()):
        raise SettingsError(f"result folder {folder} is not empty; choose another with --out")
    parent = folder.absolute()
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir():
        raise SettingsError(f"result folder {folder}: {parent} is a file")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise SettingsError(f"result folder {folder}: no permission to write in {parent}")
    return folder.absolute()
