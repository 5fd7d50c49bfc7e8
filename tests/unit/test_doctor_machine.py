"""uam doctor: cores, memory, timer, rendering."""

from collections import namedtuple

import numpy as np
import pytest

from uam_control.settings.configuration import ConfigurationError
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes import shared_memory
from uam_lab.flights.ros import supervise
from uam_lab.preflight.doctor import machine, rendering
from uam_lab.preflight.doctor.check_process import TOO_LATE, Said
from uam_lab.preflight.doctor.finding import Verdict
from uam_lab.report.video import opengl

OK, WARN, FAIL = Verdict


@pytest.mark.parametrize(
    ("count", "load", "verdict"), [(1, 0.0, WARN), (2, 0.5, OK), (2, 5.0, WARN), (8, 5.0, OK)]
)
def test_cores(count, load, verdict):
    assert machine.cores(count, load).verdict is verdict


@pytest.mark.parametrize(("free", "verdict"), [(8.0, OK), (2.0, OK), (1.9, WARN)])
def test_memory(free, verdict):
    assert machine.memory(free).verdict is verdict


def test_a_timer_that_oversleeps_a_control_period_is_no_real_time():
    late = np.full(250, 1e-4)
    assert machine.timer(late).verdict is OK
    late[:10] = 0.02
    found = machine.timer(late)
    assert found.verdict is WARN and "miss ticks" in found.advice


def test_sleeps_never_end_early():
    assert (machine.oversleep(count=5, tick=0.001) > -1e-4).all()


def test_a_frame_is_drawn_or_the_packages_are_named():
    (found,) = rendering.checks()
    assert found.verdict is OK or "apt install libegl1" in found.advice or TOO_LATE in found.found


def test_an_empty_picture_is_a_warning():
    facts = {"frame_s": 0.1, "contrast": 0.0, "device": "llvmpipe (LLVM 15)"}
    assert rendering.drawn("egl", Said(facts)).verdict is WARN
    found = rendering.drawn("egl", Said(facts | {"contrast": 40.0}))
    assert found.verdict is OK and "in software" in found.found


def test_without_opengl_flights_still_work(monkeypatch):
    monkeypatch.setattr(opengl, "FALLBACKS", ("no-such-platform",))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    (found,) = rendering.checks()
    assert found.verdict is WARN


def test_a_full_shared_memory_is_found_before_a_flight(tmp_path, monkeypatch):
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shared_memory.psutil, "disk_usage", lambda place: usage(8e6))
    assert shared_memory.shortage(tmp_path) == ""
    assert machine.shared("").verdict is OK
    monkeypatch.setattr(shared_memory.psutil, "disk_usage", lambda place: usage(7.9e6))
    text = shared_memory.shortage(tmp_path)
    assert text.startswith(f"{tmp_path} has 7.9 MB left, 8 MB are needed: nodes would end")
    found = machine.shared(text)
    assert found.verdict is FAIL and found.advice.startswith("remove what")
    monkeypatch.setattr(supervise, "shortage", lambda: text)
    with pytest.raises(ConfigurationError, match="SIGBUS"):
        supervise.prepare([], Observer())


def test_without_a_place_for_shared_memory_nothing_lacks(tmp_path):
    assert shared_memory.shortage(tmp_path / "absent") == ""
