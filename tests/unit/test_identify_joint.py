"""Identification: the parameters put into an emulated servo are found; criteria to abort."""

import dataclasses
import math
from contextlib import closing

import numpy as np
import pytest
import yaml
from arm_rig import BAUD, ArmRig
from hypothesis import given, settings
from hypothesis import strategies as st
from servo_shafts import FrictionShaft
from set_clock import SetClock

from uam_lab.cli import identify_joint
from uam_lab.cli.main import main
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedBus, EmulatedServo
from uam_sim_bridge.devices.dynamixel.excitation import (
    Aborted,
    Excitation,
    ExcitationParameters,
    Record,
    centre_of,
    excite,
)
from uam_sim_bridge.devices.dynamixel.friction_fit import FitError, fit_friction

NOMINAL = 1.304  # [N m/A] torque_per_current of the vehicle
SHORT = ExcitationParameters(duration=12.0, approach=1.0)


class Bench:
    """Two joints with friction; the second is excited."""

    def __init__(self, **shaft):
        self.clock = SetClock(100.0)
        self.weight_at_90 = shaft.get("weight", 0.5)
        shaft = {"weight": self.weight_at_90, "inertia": 0.006} | shaft
        self.shafts = [
            FrictionShaft(angle=0.0, clock=self.clock),
            FrictionShaft(angle=math.pi / 2, clock=self.clock, **shaft),
        ]
        self.rig = ArmRig(self.shafts, clock=self.clock).start()

    def weight(self, angle):
        return np.array([0.0, self.weight_at_90 * math.sin(angle)])

    def pace(self):
        self.clock.now += 0.004
        return self.clock.now

    def excite(self, parameters=SHORT, during=lambda time: None):
        driver, begun = self.rig.driver, self.clock.now

        def pace():
            during(self.clock.now - begun)
            return self.pace()

        centre = centre_of(driver, 1, math.pi / 2, parameters)
        return excite(driver, 1, centre, self.weight, parameters, pace)

    def fit(self, record):
        return fit_friction(record, 1, self.weight_at_90 * np.sin(record.position[:, 1]))


@settings(max_examples=3)
@given(st.floats(0.85, 1.15), st.floats(0.05, 0.25), st.floats(0.02, 0.1), st.floats(0.3, 0.7))
def test_the_parameters_of_the_servo_are_found(scale, coulomb, viscous, weight):
    bench = Bench(torque_constant=scale * NOMINAL, coulomb=coulomb, viscous=viscous, weight=weight)
    fit = bench.fit(bench.excite())
    assert fit.scale_known and fit.scale == pytest.approx(scale, rel=0.02)
    assert fit.coulomb == pytest.approx(coulomb, rel=0.03, abs=0.002)
    assert fit.viscous == pytest.approx(viscous, rel=0.04, abs=0.002)
    assert fit.inertia == pytest.approx(0.006, rel=0.1)


def test_without_weight_the_torque_constant_is_not_claimed():
    bench = Bench(torque_constant=0.9 * NOMINAL, coulomb=0.15, viscous=0.05, weight=0.0)
    fit = bench.fit(bench.excite())
    assert not fit.scale_known and fit.scale == 1.0
    # in units of the nominal constant
    assert fit.coulomb == pytest.approx(0.15 / 0.9, rel=0.04)


def test_the_joint_returns_to_its_start():
    bench = Bench(coulomb=0.05)
    bench.excite()
    assert bench.shafts[1].angle == pytest.approx(math.pi / 2, abs=0.06)
    assert bench.shafts[0].angle == pytest.approx(0.0, abs=0.06)


@given(st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(5.0, 90.0), st.floats(0.05, 1.0))
def test_the_motion_is_smooth_and_within_its_amplitude(start, centre, amplitude, frequency):
    p = ExcitationParameters(amplitude_deg=amplitude, frequency=frequency, duration=6.0)
    motion = Excitation(start, centre, p)
    times = np.linspace(0.0, motion.total, 4001)
    angle, rate = np.array([motion.at(time) for time in times]).T
    assert angle[0] == pytest.approx(start) and angle[-1] == pytest.approx(start, abs=1e-6)
    inside = (times >= motion.begin) & (times < motion.end)
    assert np.all(np.abs(angle[inside] - centre) <= math.radians(amplitude) + 1e-9)
    numeric = np.gradient(angle, times)
    assert np.max(np.abs(numeric - rate)[1:-1]) < 0.02 * (1.0 + np.max(np.abs(rate)))


def test_the_centre_keeps_the_motion_in_the_range():
    driver = Bench().rig.driver  # -120 to 120 deg
    p = ExcitationParameters(amplitude_deg=40.0, margin_deg=5.0)
    assert math.degrees(centre_of(driver, 1, math.radians(90.0), p)) == pytest.approx(75.0)
    assert math.degrees(centre_of(driver, 1, math.radians(-10.0), p)) == pytest.approx(-10.0)
    driver.chain = dataclasses.replace(
        driver.chain,
        servos=tuple(dataclasses.replace(s, low=-0.5, high=0.5) for s in driver.chain.servos),
    )
    with pytest.raises(Aborted, match="amplitude_deg 40 does not fit .* at most 24"):
        centre_of(driver, 1, 0.0, p)


def aborted(during, bench=None, parameters=SHORT):
    bench = bench or Bench()
    with pytest.raises(Aborted) as stopped:
        bench.excite(parameters, lambda time: during(bench, time))
    assert not any(shaft.last.on for shaft in bench.shafts)  # torque off
    return str(stopped.value)


def test_a_lost_servo_aborts():
    def lose(bench, time):
        bench.rig.servos[1].connected = time < 3.0 or bench.rig.driver._open is False

    bench = Bench()
    with pytest.raises(Aborted, match=r"alpha_2 \(id 2\): no answer to the last 5 reads"):
        bench.excite(during=lambda time: lose(bench, time))


def test_an_overload_aborts():
    def fail(bench, time):
        if 3.0 < time < 3.01:
            bench.rig.servos[1].raise_error("overload")

    assert "alpha_2 (id 2): overload" in aborted(fail)


def test_a_warm_servo_aborts():
    def heat(bench, time):
        bench.rig.servos[0].temperature = 35.0 if time < 2.0 else 66.0

    assert aborted(heat) == "alpha_1 (id 1): 66 deg C, 60 allowed"


def test_a_blocked_joint_aborts():
    def block(bench, time):
        bench.shafts[1].coulomb = 0.1 if time < 3.0 else 50.0

    text = aborted(block)
    assert text.startswith("alpha_2 (id 2): ")
    assert text.endswith("0.5 allowed: blocked, too heavy, or a wrong direction?")


def test_interrupt_switches_the_torque_off():
    bench = Bench()

    def interrupt(time):
        if time > 2.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bench.excite(during=interrupt)
    assert not any(shaft.last.on for shaft in bench.shafts)


def record(velocity, effort, seconds=10.0):
    times = np.arange(0.0, seconds, 0.004)
    angle = np.cumsum(velocity(times)) * 0.004
    column = effort(times)
    return Record(times, angle[:, None], velocity(times)[:, None], column[:, None])


def test_motion_in_one_direction_is_refused():
    one_way = record(lambda t: 1.0 + 0.5 * np.sin(t), lambda t: 0.1 + 0.0 * t)
    with pytest.raises(FitError, match="in both directions"):
        fit_friction(one_way, 0, np.zeros(len(one_way.times)))


def test_few_samples_are_refused():
    short = record(lambda t: np.sin(6 * t), lambda t: 0.1 * np.sign(np.sin(6 * t)), seconds=0.5)
    with pytest.raises(FitError, match="125 samples, 200 needed"):
        fit_friction(short, 0, np.zeros(len(short.times)))


def test_the_command_on_a_device(tmp_path, monkeypatch, capsys):
    """Behind a pseudo-terminal, its time by hand; the weight is that of the vehicle's arm."""
    clock = SetClock(100.0)
    # the second joint at 90 deg carries 0.09 kg at 75 mm; magnet and load at 140 mm
    weight = 9.81 * (0.09 * 0.075 + (0.07 + 0.2) * 0.140)
    shafts = [
        FrictionShaft(angle=0.0, clock=clock),
        FrictionShaft(0.006, 0.15, 0.05, 0.95 * NOMINAL, weight, math.pi / 2, clock=clock),
    ]
    shafts[0].coulomb = 20.0  # it stays
    servos = [
        EmulatedServo(i + 1, one, baud_rate=BAUD, clock=clock) for i, one in enumerate(shafts)
    ]

    def pacing(rate):
        def pace():
            clock.now += 1.0 / rate
            return clock.now

        return pace

    monkeypatch.setattr(identify_joint, "pacing", pacing)
    monkeypatch.setattr(identify_joint, "CLOCK", clock)
    with closing(EmulatedBus(servos)) as device:
        wait = ["--answer-timeout", "5", "--device", device.port]
        monkeypatch.setattr("builtins.input", lambda text: "no")
        assert main(["identify-joint", "alpha_2", *wait, "--out", str(tmp_path / "none")]) == 1
        assert "not confirmed: nothing moved" in capsys.readouterr().out
        out = tmp_path / "out"
        unwritable = ["--yes", "--out", str(tmp_path / "file" / "out")]
        (tmp_path / "file").touch()
        assert main(["identify-joint", "alpha_2", *wait, *unwritable]) == 2
        assert "cannot be written" in capsys.readouterr().err
        assert shafts[1].angle == math.pi / 2  # refused before the joint moved
        more = ["--yes", "--load", "0.2", "--duration", "8", "--out", str(out)]
        assert main(["identify-joint", "alpha_2", *wait, *more]) == 0
        assert not any(shaft.last.on for shaft in shafts)
    text = (out / "identification.yaml").read_text()
    (found,) = yaml.safe_load(text)
    assert found["joint"] == "alpha_2"
    assert found["torque_scale"] == pytest.approx(0.95, rel=0.03)
    assert found["coulomb"] == pytest.approx(0.15, rel=0.05)
    assert found["viscous"] == pytest.approx(0.05, rel=0.08)
    assert (out / "friction.png").stat().st_size > 10_000
    assert len((out / "samples.csv").read_text().splitlines()) > 1000


def test_the_command_refuses_in_one_line(capsys):
    assert main(["identify-joint", "elbow"]) == 2
    assert "no joint 'elbow'; there are: alpha_1, alpha_2" in capsys.readouterr().err
    assert main(["identify-joint", "alpha_1", "--device", "/dev/ttyNONE", "--yes"]) == 2
    assert capsys.readouterr().err == "uam identify-joint: /dev/ttyNONE: does not exist\n"
    assert main(["identify-joint", "alpha_1", "--config", "none"]) == 2
    assert "unknown lab 'none'" in capsys.readouterr().err
