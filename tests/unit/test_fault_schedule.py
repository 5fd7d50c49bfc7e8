"""Faults are read from options, files and scenarios, and refused in one line."""

from __future__ import annotations

import dataclasses
import math
import re

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from uam_control.mission import ScenarioError, load_scenario
from uam_control.settings import configuration
from uam_control.settings.parameter_set import Bound, Choice
from uam_lab.flights.processes import thread_stop
from uam_sim_bridge.faults import (
    CABLE,
    FAULTS,
    LINK,
    PLANT,
    PROCESS,
    FaultError,
    Schedule,
    feasibility,
    read_schedule,
)
from uam_sim_bridge.faults.schedule import KEYS, TimedFault, late, parse_spec, timed
from uam_sim_bridge.faults.timeline import Timeline

SCENARIO = load_scenario("pick_and_place")
times = st.floats(0.0, 1000.0).map(lambda value: round(value, 3))
spans = times.filter(bool)


def one(text):
    (found,) = read_schedule([text], SCENARIO, 1).faults
    return found


@st.composite
def faults(draw):
    """Draw a fault with allowed parameters."""
    kind = FAULTS[draw(st.sampled_from(sorted(FAULTS)))]
    values = {}
    for name, spec in kind.specs().items():
        if isinstance(spec, Choice):
            values[name] = draw(st.sampled_from(spec.choices))
        elif spec.whole:
            values[name] = draw(st.integers(round(spec.low), round(spec.high)))
        else:
            values[name] = draw(st.floats(spec.low, spec.high))
    return kind.from_mapping(values)


@given(
    st.builds(TimedFault, faults(), times, spans | st.just(math.inf), st.sampled_from(["", "pick"]))
)
def test_the_option_text_of_a_fault_is_read_back(fault):
    entry = parse_spec(fault.text)
    assert timed(entry, None, "") == fault
    assert fault.text.count("=") == sum(
        value != getattr(type(fault.fault)(), name)
        for name, value in fault.fault.to_mapping().items()
    )


@given(st.lists(st.builds(TimedFault, faults(), times, spans | st.just(math.inf)), max_size=4))
def test_a_schedule_is_read_back_from_the_parameter_of_a_node_and_from_a_file(found):
    made = Schedule(tuple(found), 7)
    assert Schedule.from_text(made.to_text()) == (made if found else Schedule())
    entries = yaml.safe_load(yaml.safe_dump(made.entries))
    again = read_schedule([], dataclasses.replace(SCENARIO, faults=tuple(entries)), 7)
    assert again == made


@given(faults(), times, spans | st.none())
def test_an_option_equals_an_entry(fault, at, duration):
    lasting = "" if duration is None else f"+{duration!r}"
    values = ",".join(f"{name}={value}" for name, value in fault.to_mapping().items())
    found = one(f"{fault.NAME}@{at!r}{lasting}" + (f":{values}" if values else ""))
    assert found == TimedFault(fault, at, math.inf if duration is None else duration)


@given(st.text(max_size=40))
def test_any_option_is_read_or_refused(text):
    try:
        read_schedule([text], SCENARIO, 1)
    except FaultError as error:
        assert str(error)


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_is_found_by_its_name(name):
    found = one(f"{name}@20+3")
    assert (type(found.fault), found.at, found.duration) == (FAULTS[name], 20.0, 3.0)
    assert FAULTS[name].ABOUT and FAULTS[name].PLACE in (PLANT, LINK, PROCESS, CABLE)


@pytest.mark.parametrize(
    ("name", "parameter"), [(n, p) for n, kind in FAULTS.items() for p in kind.specs()]
)
def test_every_parameter_has_a_range_that_is_kept(name, parameter):
    spec = FAULTS[name].specs()[parameter]
    assert parameter not in KEYS
    bad = "nonsense"
    if isinstance(spec, Bound):
        assert spec.unit or spec.whole
        assert spec.low <= getattr(FAULTS[name](), parameter) <= spec.high
        bad = spec.high + 1
    for value in (bad, "nan", "true"):
        with pytest.raises(FaultError, match=f"{name}: {parameter}: "):
            one(f"{name}@20:{parameter}={value}")


def test_a_phase_means_its_beginning():
    found = one("motor_loss@pick+1:motor=2,remaining=0.7")
    assert (found.phase, found.at, found.duration) == ("pick", 1.0, math.inf)
    assert (found.fault.motor, found.fault.remaining) == (2.0, 0.7)
    assert one("mocap_dropout@take-off") == TimedFault(
        FAULTS["mocap_dropout"](), 0.0, phase="take-off"
    )
    found = one("mocap_dropout@land+0.5+2")
    assert (found.phase, found.at, found.duration) == ("land", 0.5, 2.0)
    schedule = Schedule((found,), 3)
    assert Schedule.from_text(schedule.to_text()) == schedule


@given(st.floats(0.0, 30.0), st.floats(0.0, 30.0), times)
def test_a_fault_of_a_phase_follows_the_flight(wait, after, duration):
    """The phase begins `wait` seconds later than planned; it comes a second time."""
    takeoff, planned = 100.0, 6.0
    line = Timeline(Schedule((TimedFault(FAULTS["mocap_dropout"](), after, duration, "pick"),)))
    line.mission_at(takeoff, 0.0, "take-off")
    assert not line.update(takeoff + planned + wait + after)  # the phase has not begun
    line.mission_at(takeoff + planned + wait, planned, "pick")
    line.mission_at(takeoff + planned + wait + after, planned, "pick")
    before = takeoff + planned + wait + after - 1e-3
    assert not line.update(before)
    (begun,) = line.update(before + 2e-3)
    assert begun.begin == pytest.approx(planned + wait + after, abs=2e-3)
    line.mission_at(before + 1.0, planned, "pick")
    line.update(before + 1e6)
    assert begun.end is not None and len(line.records) == 1


REFUSED = {
    "mocap_dropot@20": "unknown fault 'mocap_dropot'; there are: mocap_dropout, mocap_freeze",
    "mocap_dropout": "NAME@SECONDS[+DURATION], NAME@PHASE",
    "mocap_dropout@": "NAME@SECONDS[+DURATION], NAME@PHASE",
    "mocap_dropout@20+3+4": "NAME@SECONDS[+DURATION], NAME@PHASE",
    "mocap_dropout@picking": "no phase 'picking' in the scenario, which has: take-off, approach",
    "mocap_dropout@-1": "at: -1.0 is not a time within 0 to",
    "mocap_dropout@20+-3": "duration: -3.0 is not a time",
    "mocap_dropout@20+0": "duration: 0 s is no fault; without a duration it lasts",
    "mocap_dropout@20+long": "duration: 'long' is not a time",
    "mocap_dropout@pick+nan": "after: nan is not a time",
    "mocap_dropout@inf": "at: inf is not a time",
    "mocap_dropout@20:": "NAME@SECONDS[+DURATION], NAME@PHASE",
    "mocap_dropout@20:speed=3": "speed: unknown; allowed: nothing",
    "motor_loss@20:motor=2.5": "motor: 2.5 is no integer",
    "motor_loss@20:motor=13": "motor: 13 is outside 1 to 12",
    "motor_loss@20:motor": "'motor' is not one parameter=value",
    "motor_loss@20:motor=1,motor=2": "'motor=2' is not one parameter=value",
    "motor_loss@20:at=3": "'at=3' is not one parameter=value",
    "motor_loss@20:after=3": "after: only together with a phase",
    "node_kill@20:node=plant": "'plant' is not one of state_estimator",
    "no.yaml": "no.yaml: No such file",
}


@pytest.mark.parametrize("text", REFUSED)
def test_bad_options_are_refused_in_one_line(text):
    with pytest.raises(FaultError, match=re.escape(REFUSED[text])) as refusal:
        one(text)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("text", ["faults: 3", "- mocap_dropout@20", "a: [", "faults: [[]]"])
def test_a_bad_file_is_named(tmp_path, text):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(FaultError, match="mine.yaml"):
        read_schedule([str(file)], SCENARIO, 1)


def test_faults_of_file_option_and_scenario_are_joined(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("- {fault: servo_jam, at: carry, after: 2, duration: 5, joint: 2}\n")
    text = configuration.path("scenarios/hover.yaml").read_text()
    own = tmp_path / "own.yaml"
    own.write_text(text + "faults:\n  - {fault: wind_gust, at: hover}\n")
    flown = dataclasses.replace(load_scenario(str(own)), phases=SCENARIO.phases + ((99, "hover"),))
    found = read_schedule([str(file), "clock_jump@3"], flown, 1).faults
    assert [(f.fault.NAME, f.phase, f.at) for f in found] == [
        ("wind_gust", "hover", 0.0),
        ("servo_jam", "carry", 2.0),
        ("clock_jump", "", 3.0),
    ]
    own.write_text(text + "faults: 3\n")
    with pytest.raises(ScenarioError, match="'faults' is not a list"):
        load_scenario(str(own))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("node_kill@20", "has no processes: needs --engine ros"),
        ("mavlink_corruption@20:direction=from_autopilot", "connection from the autopilot: needs"),
        ("mavlink_cut@20:direction=from_autopilot", "connection from the autopilot: needs"),
    ],
)
def test_faults_that_the_direct_engine_refuses(text, why):
    found = read_schedule([text], SCENARIO, 1)
    with pytest.raises(FaultError, match=why):
        feasibility.check(found, "direct")
    feasibility.check(found, "ros")


def test_a_process_that_is_not_started_cannot_be_killed():
    found = read_schedule(["node_stall@20+1:node=scene"], SCENARIO, 1)
    with pytest.raises(FaultError, match="node_stall: this flight does not start scene"):
        feasibility.check(found, "ros", ("scene",))


def test_a_fault_that_the_machine_does_not_allow_is_refused_with_the_reason(monkeypatch, tmp_path):
    found = read_schedule(["discovery_loss@20+1"], SCENARIO, 1)
    scope = tmp_path / "ptrace_scope"
    monkeypatch.setattr(thread_stop, "SCOPE", scope)
    monkeypatch.setattr(thread_stop.os, "geteuid", lambda: 1000)
    for there, refused in ((None, False), ("0", False), ("1", False), ("2", True), ("3", True)):
        if there:
            scope.write_text(f"{there}\n")
        why = thread_stop.refusal()
        assert bool(why) == refused
        if refused:
            with pytest.raises(FaultError, match=f"not on this machine: .*scope is {there}"):
                feasibility.check(found, "ros", (), {"discovery_loss": why})
        else:
            feasibility.check(found, "ros", (), {"discovery_loss": why})


@given(times, times, st.floats(0.0, 50.0))
def test_a_fault_lasts_from_its_time_to_its_end(at, duration, takeoff):
    line = Timeline(Schedule((TimedFault(FAULTS["mocap_dropout"](), at, duration),)))
    line.update(takeoff + at)
    assert line.records == []  # no mission time yet
    line.mission_at(takeoff - 1.0, -1.0, "take-off")
    line.mission_at(takeoff + 0.25, 0.25, "take-off")
    line.mission_at(takeoff + 9.0, 1.0, "take-off")  # after a hold, which stops the mission time
    step = max(0.5, (at + duration) / 200.0)
    for tick in range(int((at + duration) / step) + 3):
        line.update(takeoff + tick * step)
    (record,) = line.records
    assert at - 1e-5 <= record["begin_s"] <= at + step + 1e-5
    assert 0.0 <= record["end_s"] - at - duration + 1e-5 <= 2.0 * step + 1e-5


@given(times, times, st.floats(0.0, 50.0))
def test_for_as_long_as_it_says_a_timeline_changes_nothing(at, duration, takeoff):
    line = Timeline(Schedule((TimedFault(FAULTS["mocap_dropout"](), at, duration),)))
    assert line.unchanged_for(takeoff) == 0.0  # the take-off may come at any time
    line.mission_at(takeoff, 0.0, "take-off")
    step, promised, began = max(0.5, (at + duration) / 200.0), 0.0, 0
    for tick in range(int((at + duration) / step) + 3):
        stamp = takeoff + tick * step
        changed = line.update(stamp)
        assert not changed or stamp >= promised - 1e-9
        began += len(changed)
        promised = stamp + line.unchanged_for(stamp)
    assert began == 2 and promised == math.inf


def test_until_its_phase_begins_a_fault_changes_nothing():
    line = Timeline(Schedule((TimedFault(FAULTS["mocap_dropout"](), 1.0, 2.0, "pick"),)))
    line.mission_at(5.0, 0.0, "take-off")
    assert line.unchanged_for(6.0) == math.inf
    line.mission_at(8.0, 3.0, "pick")  # from 9 s on
    assert line.unchanged_for(8.0) == pytest.approx(1.0, abs=1e-5)


def test_numbers_of_an_option():
    assert parse_spec("x@1e1+2:a=3,b=c") == {
        "fault": "x",
        "at": 10.0,
        "duration": 2.0,
        "a": 3.0,
        "b": "c",
    }


def test_a_fault_from_the_start_acts_before_take_off_and_lasts():
    (text,) = late(0.016, 0.004, 0.0, 0.0)
    schedule = read_schedule([text, "mavlink_cut@2+1"], SCENARIO, 1)
    again = Schedule.from_text(schedule.to_text())
    assert again == schedule
    timeline = Timeline(again)
    assert [one.fault.NAME for one in timeline.update(0.1)] == ["mavlink_delay"]
    assert timeline.update(0.2) == []
    assert timeline.records == [
        {
            "fault": "mavlink_delay",
            "begin_s": 0.0,
            "end_s": None,
            "parameters": {"direction": "to_autopilot", "delay": 0.016, "jitter": 0.004},
        }
    ]
    timeline.mission_at(10.0, 0.0, "take-off")
    assert [one.fault.NAME for one in timeline.update(12.1)] == ["mavlink_cut"]
    assert [one.end is None for one in timeline.update(13.1)] == [False]
    assert timeline.all[0].active


@pytest.mark.parametrize("more", ["after: 1", "duration: 2"])
def test_a_fault_from_the_start_has_no_time(more):
    entry = yaml.safe_load(f"{{fault: mocap_latency, at: start, {more}}}")
    with pytest.raises(FaultError, match="lasts for the whole flight"):
        timed(entry, {}, "here")


def test_delays_of_nothing_are_no_faults():
    assert late(0.0, 0.0, 0.0, 0.0) == []
    assert late(0.0, 0.0, 0.0, 0.002) == ["mocap_latency@start:delay=0,jitter=0.002"]
