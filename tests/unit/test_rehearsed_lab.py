"""The rehearsed lab file, the figures of the devices, and the judgement of a rehearsal."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from uam_control.settings.preflight_check import PreflightCheck
from uam_lab.cli.main import main
from uam_lab.experiments.faults import rehearsed
from uam_lab.experiments.faults.matrix import Cell, Promise
from uam_lab.experiments.faults.rehearsed import judged, with_checklist
from uam_lab.experiments.trials.outcome import LOST, REFUSED
from uam_lab.flights.operator import DECODE
from uam_lab.flights.processes.interrupts import INTERRUPTED
from uam_lab.flights.rehearsal import device_figures, laboratory_process
from uam_lab.flights.rehearsal.engine import REFUSED as REFUSAL
from uam_lab.flights.vehicle.lab_file import LabError, load_lab, settings_of, template
from uam_lab.records.recording.logged_topics import latencies
from uam_lab.records.results.outcome import Outcome
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import checklist_message
from uam_msgs_py.messages.status import ChecklistState
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.schedule import timed
from uam_sim_bridge.mavlink.telemetry.required_parameters import RequiredParameters
from uam_sim_bridge.ports import Ports
from uam_sim_bridge.px4 import hitl, px4_parameters
from uam_sim_bridge.px4.px4_installation import Px4Installation

REPLACED = {
    ("arm", "device"),
    ("autopilot",),
    ("mocap", "server"),
    ("mocap", "command_port"),
    ("mocap", "local"),
    ("magnet", "chip"),
}


def flat(value, path=()):
    """Return the entries of a document by their path."""
    if isinstance(value, dict):
        return {k: v for key, one in value.items() for k, v in flat(one, (*path, key)).items()}
    return {path: value}


def given(folder: Path, **changes) -> Path:
    document = yaml.safe_load(template())
    for name, value in changes.items():
        document[name] = document[name] | value if isinstance(value, dict) else value
    file = folder / "my_lab.yaml"
    file.write_text(yaml.safe_dump(document))
    return file


def test_only_the_names_of_devices_are_replaced(tmp_path):
    lab = load_lab(
        given(
            tmp_path,
            mocap={"local": "192.168.1.9", "payload": "box"},
            cockpit={"address": "0.0.0.0"},
        )
    )
    document = laboratory_process.emulated_lab(lab, tmp_path / "devices", 40000)
    rehearsed = laboratory_process.write_lab(document, lab.file, tmp_path)
    before, after = flat(yaml.safe_load(lab.file.read_text())), flat(document)
    changed = {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)}
    # files are written in full, since the new file lies elsewhere
    assert changed - {("vehicle",), ("mocap", "calibration"), ("profile",)} == REPLACED
    assert rehearsed.autopilot == f"serial:{tmp_path}/devices/ttyTELEM2:921600"
    assert rehearsed.arm.device == f"{tmp_path}/devices/ttyARM"
    assert rehearsed.magnet.line.chip == f"simulated:{tmp_path}/devices/magnet"
    assert (rehearsed.mocap.server, rehearsed.mocap.command_port) == ("127.0.0.1", 40000)
    assert (rehearsed.mocap.body, rehearsed.mocap.payload) == ("uam", "box")
    assert rehearsed.arm.servos == lab.arm.servos and rehearsed.room == lab.room
    assert rehearsed.cockpit == lab.cockpit
    assert rehearsed.scenario == lab.scenario and rehearsed.vehicle == lab.vehicle


def test_files_beside_the_lab_file_are_found_from_the_result_folder(tmp_path):
    folder, out = tmp_path / "lab", tmp_path / "results"
    for each in (folder, out):
        each.mkdir()
    nominal = Path("config/mocap/motive_z_up.yaml").read_text()
    (folder / "my_mocap.yaml").write_text(nominal)
    arm = yaml.safe_load(template())["arm"]
    (folder / "my_arm.yaml").write_text(yaml.safe_dump({"arm": arm | {"baud_rate": 2000000}}))
    lab = load_lab(given(folder, arm="my_arm.yaml", mocap={"calibration": "my_mocap.yaml"}))
    rehearsed = laboratory_process.write_lab(
        laboratory_process.emulated_lab(lab, out, 40000), lab.file, out
    )
    assert rehearsed.arm.baud_rate == 2000000
    assert Path(rehearsed.mocap.calibration).read_text() == nominal


def test_another_kind_of_motion_capture_cannot_be_rehearsed(tmp_path):
    lab = load_lab(given(tmp_path, mocap={"source": "motioncapture"}))
    with pytest.raises(LabError, match="source: motioncapture: only natnet can be rehearsed"):
        laboratory_process.emulated_lab(lab, tmp_path, 40000)


PORTS = Ports(3, 4, 4563, 14543, 14583)


def words(arguments):
    """Return option → the words after it."""
    found, key = {}, ""
    for word in arguments:
        if word.startswith("--"):
            key = word
            found.setdefault(key, [])
        else:
            found[key].append(word)
    return found


def test_the_autopilot_is_the_stand_in_or_px4_on_both_of_its_lines(tmp_path):
    lab = load_lab(given(tmp_path, autopilot="serial:/dev/ttyUSB9:460800"))
    settings, devices = settings_of(lab), tmp_path / "devices"
    module, own = laboratory_process.autopilot(lab, settings, devices, tmp_path, PORTS)
    assert module == "uam_sim_bridge.autopilot.server" and words(own)["--sim-port"] == ["4563"]
    assert words(own)["--companion"] == [f"{devices}/ttyAUTOPILOT:460800"]
    px4 = Px4Installation(tmp_path)
    settings = replace(settings, px4=px4, px4_params=("SDLOG_MODE=0",))
    module, own = laboratory_process.autopilot(lab, settings, devices, tmp_path, PORTS)
    found = words(own)
    assert module == "uam_sim_bridge.px4.hitl" and found["--instance"] == ["3"]
    assert found["--companion"] == [f"{devices}/ttyAUTOPILOT:460800"]
    assert found["--usb"] == [f"{devices}/ttyUSB"] and found["--px4-dir"] == [str(tmp_path)]
    assert found["--param"] == ["SDLOG_MODE=0"] and found["--log"] == [f"{tmp_path}/px4.ulg"]
    assert [Path(one).name for one in found["--params"]] == ["sitl.yaml", "rehearsed.yaml"]
    values = laboratory_process.parameters(lab, settings, devices, tmp_path, PORTS)
    surroundings = settings.scenario.surroundings
    assert surroundings.items() <= json.loads(values["vehicle_changes"]).items()
    assert values["hil"] == "line"
    # what PX4 gets is what the list of a vehicle requires, except that it is in the loop
    values = px4_parameters.load(lab.vehicle, found["--params"], found["--param"])
    required = laboratory_process.required_parameters(px4, tmp_path)
    rules = RequiredParameters.read(required["required_parameters"])
    assert set(rules) == set(RequiredParameters.read("vehicle"))
    for name, value in hitl.loop_values(values, lab.vehicle).items():
        assert name not in rules or name == "SDLOG_MODE" or rules[name].met(value), name
    assert rules["SYS_HITL"].met(1) and not rules["SYS_HITL"].met(0)
    assert laboratory_process.required_parameters(None, tmp_path) == {}


def test_a_gripper_is_on_its_output(tmp_path):
    magnet = {"through": "autopilot", "magnet": "gripper", "magnet_output": 2}
    document = yaml.safe_load(template()) | {"magnet": magnet}
    file = tmp_path / "lab.yaml"
    file.write_text(yaml.safe_dump(document))
    lab = load_lab(file)
    settings = replace(settings_of(lab), px4=Px4Installation(tmp_path))
    _, own = laboratory_process.autopilot(lab, settings, tmp_path, tmp_path, PORTS)
    assert words(own)["--param"] == ["PWM_MAIN_FUNC12=430"]
    values = laboratory_process.parameters(lab, settings, tmp_path, tmp_path, PORTS)
    assert (values["magnet_on"], values["magnet_off"], values["magnet_output"]) == (1, -1, 2)


def report(name, **values):
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name=name, values=pairs)])


def test_the_figures_of_the_devices():
    bus = [{"bus rate [Hz]": rate, "cycle, max [ms]": "3.5"} for rate in ("249.0", "nan", "251.0")]
    found = device_figures.of_reports(
        device_figures.values_of(
            [*(report("arm_driver", **one) for one in bus), report("mission", phase="land")]
        )
    )
    assert found == {"bus_rate_hz": 249.0, "bus_cycle_max_ms": 3.5}
    numbers = {"wall_s": 10.0, "serial_bytes": [90000, 210000], "late_ticks": 3, "lost_s": 0.0}
    found |= device_figures.of_laboratory(numbers)
    assert found["serial_to_autopilot_kbyte_s"] == 9.0
    assert found["serial_from_autopilot_kbyte_s"] == 21.0
    assert device_figures.lines(found)[0].startswith("servo bus  bus rate hz 249")
    assert device_figures.of_laboratory({}) == {} and device_figures.lines({}) == []


def test_a_bus_that_is_slow_by_its_computer_is_named():
    """95 % of 250 Hz are 237.5 Hz."""
    figures = {"bus_rate_hz": 237.0, "bus_rate_possible_hz": 962.0}
    (note,) = device_figures.slow_computer(figures, 250.0)
    assert note.startswith("this computer was too slow for the servo bus: 237 Hz of 250 Hz")
    for other in ({"bus_rate_hz": 238.0}, {"bus_rate_possible_hz": 200.0}):
        assert device_figures.slow_computer(figures | other, 250.0) == []
    assert device_figures.slow_computer({}, 250.0) == []


class FakeLog:
    """Stamps and wall times of the two topics that count."""

    def __init__(self, states, setpoints, sent):
        self._times = {
            topics.STATE: (np.array(states), np.array(states)),
            topics.SETPOINT: (np.array(setpoints, np.int64), np.array(sent, np.int64)),
        }

    def published(self, topic):
        return self._times[topic]


def test_latencies_and_missed_ticks():
    ms = 1_000_000
    states = [4 * ms * k for k in range(1, 6)]
    setpoints = [states[0], states[1], states[4]]  # two ticks without a setpoint
    sent = [states[0] + 2 * ms, states[1] + 13 * ms, states[4] + 5 * ms]  # one is late
    found, missed = latencies(FakeLog(states, setpoints, sent), 0.004, np.array(states))
    assert found == pytest.approx([0.002, 0.013, 0.005]) and missed == 3
    assert latencies(FakeLog(states, [], []), 0.004, np.array(states))[1] == 5


def test_latencies_of_given_ticks():
    ms = 1_000_000
    states = [4 * ms * k for k in range(1, 6)]
    # the first tick's setpoint late and once more in time, the last one not of a tick
    log = FakeLog(states, [states[0], states[0], 1], [states[0] + 13 * ms, states[0] + ms, 2])
    found, missed = latencies(log, 0.004, np.array(states[:2]))
    assert found == pytest.approx([0.013, 0.001]) and missed == 1


def test_the_starter_reads_the_lists():
    items = [
        PreflightCheck("poses", "100 Hz", "at least 100 Hz", True, kind="automatic"),
        PreflightCheck("battery", "50 %", "at least 60 %", False, kind="automatic"),
    ]
    message = checklist_message(1, ChecklistState(False, "battery; lift"), items)
    (_, state), found = DECODE[topics.CHECKLIST](message)
    assert not state.passed and state.summary == "open: battery; lift"
    assert [one.passed for one in found] == [True, False]
    (_, state), _ = DECODE[topics.CHECKLIST](checklist_message(1, ChecklistState(True), []))
    assert state.passed


def cell(name, at, outcome):
    one = timed({"fault": name, "at": at}, {}, "test")
    return Cell(name, "m", Schedule((one,)), Promise((outcome,)))


def test_a_refused_start_is_an_outcome_of_its_own():
    wrong = cell("wrong_id", "start", REFUSED)
    outcome = Outcome(series=None, failure=REFUSAL + "arm: no answer")
    result = judged(wrong, outcome, None)
    assert (result.outcome, result.kept) == (REFUSED, True) and "no answer" in result.why
    broken = judged(wrong, Outcome(series=None, failure="mission was killed"), None)
    assert (broken.outcome, broken.kept) == (LOST, False)
    flight = cell("bus_unplugged", 3.0, "landed")
    assert judged(flight, outcome, None).kept is False  # a refusal is no landing


def test_the_lists_are_done_for_wiring_and_without_a_fault():
    assert with_checklist(cell("wrong_id", "start", REFUSED))
    assert not with_checklist(cell("bus_unplugged", 3.0, "landed"))
    assert with_checklist(Cell("no fault", "", Schedule()))


def test_ctrl_c_ends_a_matrix_of_rehearsals_and_the_same_command_continues(
    tmp_path, monkeypatch, capsys
):
    matrix, flown = tmp_path / "mine.yaml", []
    matrix.write_text(
        "{scenario: hover, moments: {start: {at: start}}, faults: [{fault: wrong_id},"
        "{fault: mocap_renamed}]}"
    )

    def fly(lab, settings, folder, observer, stop, checklist):
        flown.append(settings.faults)
        if len(flown) == 2:
            stop.repeat()
        return Outcome(series=None, failure=REFUSAL + "no answer")

    monkeypatch.setattr(rehearsed.engine, "fly", fly)
    out = tmp_path / "out"
    command = ["faults", "--engine", "rehearsal", "--matrix", str(matrix), "--out", str(out)]
    assert main(command) == INTERRUPTED and len(flown) == 2
    assert main(command) == 0 and len(flown) == 4 and flown[1] == flown[2]
    results = json.loads((out / "faults.json").read_text())
    assert "lost" not in json.dumps(results["flights"])
    capsys.readouterr()
    lab = tmp_path / "lab.yaml"
    lab.write_text(template())
    assert main([*command, "--config", str(lab)]) == 2
    assert "contains flights with other settings" in capsys.readouterr().err


def test_a_matrix_of_rehearsals_refuses_what_the_lab_file_has(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    foreign = ["--vehicle", "hexa_arm", "--profile", "s500", "--plant-preset", "calm"]
    command = ["faults", "--matrix", "cables", "--engine", "rehearsal"]
    assert main([*command, *foreign, "--effect", "ground_effect"]) == 2
    out, err = capsys.readouterr()
    assert "--vehicle, --profile, --plant-preset, --effect: not with --engine rehearsal" in err
    assert err.count("\n") == 1 and not out and not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--cable", "mocap_jump@3"], "mocap_jump: not of a cable: uam fly --fault"),
        (["--cable", "wire@3"], "unknown fault 'wire'"),
        (["--cable", "bus_unplugged@tea"], "no phase 'tea'"),
        (["--cable", "wrong_id@start:joint=9"], "joint: 9 is outside 1 to 7"),
        (["--config", "none"], "unknown lab 'none'; there are: s500_lab"),
        (["--scenario", "none"], "unknown scenario"),
    ],
)
def test_wrong_use_is_one_line(capsys, monkeypatch, tmp_path, options, message):
    monkeypatch.chdir(tmp_path)
    assert main(["rehearse", *options]) == 2
    out, err = capsys.readouterr()
    assert message in err and err.count("\n") == 1 and not out
    assert not any(tmp_path.iterdir())


def test_a_flight_without_emulated_devices_refuses_cables(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["fly", "--engine", "direct", "--fault", "bus_unplugged@3"]) == 2
    assert "only a rehearsal has cables: uam rehearse --cable" in capsys.readouterr().err
