"""CSV trajectories: what is read, what is refused, and how exactly the samples are met."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_matrix

from uam_control.grasp import grasp_windows
from uam_control.mission import ScenarioError, ScenarioOptions, load_scenario
from uam_control.mission.scenarios.fitted_spline import CurveSamples, Misfit, fitted, least_squares

HEADER = "t,px,py,pz,yaw,vx,vy,vz,ax,ay,az,dyaw"
ROW = "{t},0,0,1,0,0,0,0,0,0,0,0"
TWO_ROWS = (ROW.format(t=0), ROW.format(t=1))
AGILICIOUS = (
    "t,p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z,w_x,w_y,w_z,a_lin_x,a_lin_y,a_lin_z,a_rot_x,a_rot_y,"
    "a_rot_z,u_1,u_2,u_3,u_4,jerk_x,jerk_y,jerk_z,snap_x,snap_y,snap_z"
)


def csv_file(folder, header=HEADER, rows=TWO_ROWS):
    file = folder / "trajectory.csv"
    file.write_text("\n".join([header, *rows]) + "\n")
    return str(file)


def text(table, digits=6):
    return [",".join(f"{number:.{digits}f}" for number in row) for row in table]


def circle(times, rate=2.0):
    """Columns of HEADER: radius 1 m, yaw turns with 0.3 rad/s."""
    c, s, one = np.cos(rate * times), np.sin(rate * times), np.ones_like(times)
    return np.column_stack(
        [times, c, s, 1.2 * one, 0.3 * times, -rate * s, rate * c, 0 * one]
        + [-(rate**2) * c, -(rate**2) * s, 0 * one, 0.3 * one]
    )


def trajectory_of(scenario):
    """The leg of the samples."""
    return next(leg.path for leg in scenario.route.legs if leg.phase == "trajectory")


@pytest.mark.parametrize(
    ("columns", "step"), [(4, 0.02), (5, 0.02), (8, 0.1), (12, 0.02), (12, 0.1), (12, 0.4)]
)
def test_the_reference_is_the_planners_curve(tmp_path, columns, step):
    times = np.arange(0.0, 8.0 + step / 2, step)
    header = ",".join(HEADER.split(",")[:columns])
    scenario = load_scenario(csv_file(tmp_path, header, text(circle(times)[:, :columns])))
    assert not scenario.notes
    path, inner = trajectory_of(scenario), np.linspace(1.0, 7.0, 500)
    rows = path.rows(inner)
    for k, allowed in enumerate((1e-4, 1e-3, 1e-2, 0.05, 0.5)):  # of 2^k
        exact = 2.0**k * np.cos(2.0 * inner + k * np.pi / 2)
        assert np.abs(rows[k, :, 0] - exact).max() < allowed
    yaw = 0.3 * inner if columns > 4 else 0.0 * inner
    np.testing.assert_allclose(rows[0, :, 5], yaw, atol=1e-4)


def test_agilicious_form_with_the_heading_from_the_attitude(tmp_path):
    times = np.arange(0.0, 6.0, 0.05)
    own = circle(times)
    table = np.zeros((len(times), 30))
    table[:, 0:4] = own[:, 0:4]
    table[:, 4], table[:, 7] = np.cos(own[:, 4] / 2), np.sin(own[:, 4] / 2)
    table[:, 8:11], table[:, 14:17] = own[:, 5:8], own[:, 8:11]
    scenario = load_scenario(csv_file(tmp_path, AGILICIOUS, text(table)))
    assert not scenario.notes
    rows = trajectory_of(scenario).rows(np.array([3.0]))
    np.testing.assert_allclose(
        rows[0, 0, [0, 1, 2, 5]], [np.cos(6), np.sin(6), 1.2, 0.9], atol=1e-5
    )
    np.testing.assert_allclose(rows[1, 0, 5], 0.3, atol=1e-3)


def test_yaw_goes_on_beyond_a_turn(tmp_path):
    times = np.arange(0.0, 8.01, 0.1)
    table = circle(times)
    table[:, 4] = (2.0 * times + np.pi) % (2.0 * np.pi) - np.pi
    table[:, 11] = 2.0
    path = trajectory_of(load_scenario(csv_file(tmp_path, rows=text(table))))
    assert path.last[5] - path.first[5] == pytest.approx(16.0, abs=1e-5)


@pytest.mark.parametrize(
    ("column", "note"),
    [("vx", "vx, vy, vz do not fit"), ("ax", "ax, ay, az do not fit"), ("dyaw", "dyaw does not")],
)
def test_columns_that_contradict_the_positions_are_not_used(tmp_path, column, note):
    times = np.arange(0.0, 8.0, 0.02)
    table = circle(times)
    first = HEADER.split(",").index(column)
    table[:, first : first + (1 if column == "dyaw" else 3)] = 0.0  # as some planners write
    scenario = load_scenario(csv_file(tmp_path, rows=text(table)))
    assert note in "; ".join(scenario.notes)
    rows = trajectory_of(scenario).rows(np.array([4.0]))
    np.testing.assert_allclose(rows[:2, 0, 0], [np.cos(8), -2 * np.sin(8)], atol=1e-3)


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_rounded_numbers_give_no_jumps_of_the_jerk(tmp_path, digits):
    times = np.arange(0.0, 8.0, 0.01)
    scenario = load_scenario(csv_file(tmp_path, rows=text(circle(times), digits)))
    rows = trajectory_of(scenario).rows(np.linspace(1.0, 7.0, 2000))
    assert np.abs(rows[3, :, :2]).max() < 8.0 * 1.2 and np.abs(rows[4, :, :2]).max() < 16.0 * 2


def race(times, speed, climbs=0.0):
    """Positions, velocities, accelerations (m, 9) of a circle of 3 m, begun and ended at speed.

    climbs [m/s]: vertical speed at the begin.
    """
    w, columns = speed / 3.0, []
    for k in range(3):
        turned = w * times + k * np.pi / 2
        up = climbs * w ** (k - 1) * np.sin(turned) + (1.6 if k == 0 else 0.0)
        columns += [3.0 * w**k * np.cos(turned), 3.0 * w**k * np.sin(turned), up]
    return np.column_stack(columns)


@pytest.mark.parametrize("columns", [4, 7, 10])
@pytest.mark.parametrize(("rate", "digits"), [(50, 3), (100, 3), (200, 3), (100, 6)])
def test_a_ramp_needs_no_more_than_a_race_that_begins_at_speed(tmp_path, columns, rate, digits):
    """8.3 m/s^2, 13.9 m/s^3 and 23 m/s^4 by hand; the rounding of the rows is not in the ends."""
    times = np.arange(0.0, 4.0 + 0.5 / rate, 1.0 / rate)
    table = np.column_stack([times, race(times, 5.0)])[:, :columns]
    header = "t,px,py,pz,vx,vy,vz,ax,ay,az".split(",")[:columns]
    scenario = load_scenario(csv_file(tmp_path, ",".join(header), text(table, digits)))
    legs = scenario.route.legs
    assert [leg.phase for leg in legs] == ["run-up", "trajectory", "run-out"]
    whole, at = scenario.route.path, np.cumsum([leg.path.length for leg in legs])[:2]
    rows = whole.rows(np.linspace(0.0, whole.length, 2000))[:, :, :3]
    largest = np.linalg.norm(rows, axis=2).max(axis=1)
    assert (largest[2:] < (8.33 * 1.06, 30.0, 120.0)).all()
    assert (np.abs(rows[0]) < (4.1, 4.1, 1.7)).all()  # within 1 m of the race
    for joint in at:
        before, after = (whole.rows(np.array([joint + d]))[:, 0, :3] for d in (-1e-9, 1e-9))
        np.testing.assert_allclose(before, after, atol=1e-3)


@pytest.mark.parametrize("climbs", [0.5, 1.0])
def test_a_run_up_to_a_climb_stays_above_the_ground(tmp_path, climbs):
    times = np.arange(0.0, 1.8, 0.01)
    table = np.column_stack([times, race(times, 5.0, climbs)])
    names = "t,px,py,pz,vx,vy,vz,ax,ay,az"
    first = load_scenario(csv_file(tmp_path, names, text(table))).route.legs[0]
    assert first.phase == "run-up"
    assert first.path.rows(np.linspace(0.0, first.path.length, 500))[0, :, 2].min() > 0.5


def test_arm_angles_are_flown(tmp_path):
    times = np.arange(0.0, 4.01, 0.1)
    angles = np.column_stack([0.5 * np.sin(times), 1.2 - 0.2 * times])
    rows = text(np.hstack([circle(times), angles]))
    scenario = load_scenario(csv_file(tmp_path, HEADER + ",alpha_1,alpha_2", rows))
    found = trajectory_of(scenario).rows(np.array([2.0]))
    np.testing.assert_allclose(found[0, 0, 6:], [0.5 * np.sin(2.0), 0.8], atol=1e-4)
    np.testing.assert_allclose(found[1, 0, 6:], [0.5 * np.cos(2.0), -0.2], atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"header": "t,px,py"}, "line 1: column pz is missing beside px"),
        ({"header": "px,py,pz"}, "line 1: column t is missing"),
        ({"header": HEADER + ",speed"}, "line 1: column 'speed' is unknown; known: t,px,py"),
        ({"header": HEADER + ",yaw"}, "line 1: column yaw is there twice"),
        ({"header": HEADER + ",q_w,q_x,q_y,q_z"}, "column yaw beside q_w: only one"),
        (
            {"header": "t,px,py,pz,ax,ay,az", "rows": ["0" + ",1" * 6, ",".join("1" * 7)]},
            "ax, ay, az need vx",
        ),
        ({"rows": [ROW.format(t=0), ROW.format(t="nan")]}, "line 3 column t: 'nan'"),
        ({"rows": [ROW.format(t=1), ROW.format(t=0.5)]}, "line 3 column t: time does not increase"),
        ({"rows": [ROW.format(t=0)]}, "at least two rows"),
        ({"rows": [ROW.format(t=0), "1,0,0,x,0,0,0,0,0,0,0,0"]}, "line 3 column pz: 'x'"),
        ({"rows": [ROW.format(t=0), "1,0,0,-1,0,0,0,0,0,0,0,0"]}, "line 3 column pz: below"),
        (
            {"header": "t,p_x,p_y,p_z", "rows": ["0,0,0,1", "1,0,0,"]},
            "line 3 column p_z: '' is not a finite number",
        ),
        (
            {"header": "t,px,py,pz,qw,qx,qy,qz", "rows": ["0,0,0,1,1,0,0,0", "1,0,0,1,0,0,0,0"]},
            "line 3 column qw: the quaternion's norm is 0, 1 expected",
        ),
        (
            {"header": "t,px,py,pz,yaw", "rows": ["0,0,0,1,90", "1,0,0,1,90"]},
            "line 2 column yaw: 90 rad, more than two turns; give the heading in radians",
        ),
        (
            {
                "header": HEADER + ",alpha_1",
                "rows": [ROW.format(t=0) + ",0", ROW.format(t=1) + ",0"],
            },
            "column alpha_2 is missing beside alpha_1",
        ),
        (
            {
                "header": HEADER + ",alpha_1,alpha_2,alpha_3",
                "rows": [ROW.format(t=0) + ",0,0,0", ROW.format(t=1) + ",0,0,0"],
            },
            "column 'alpha_3' is unknown; known: .*alpha_1,alpha_2",
        ),
        (
            {
                "header": HEADER + ",alpha_1,alpha_2",
                "rows": [ROW.format(t=0) + ",0,0", ROW.format(t=1) + ",0,2.5"],
            },
            "line 3 column alpha_2: joint angle beyond its range, -2.09 to 2.09 rad",
        ),
        ({"header": "t,px,py,pz", "rows": ["0,0,0,1", "1,1,0,0,1"]}, "line 3: 5 fields, .* has 4"),
        ({"header": "t,px,py,pz", "rows": ["0,0,0,1", "1,0,1"]}, "line 3: 3 fields, .* has 4"),
        ({"header": "\n\nt,px,py,pz", "rows": ["0,0,0,1", "", " ", "1,0,0,x"]}, "line 7 column pz"),
        ({"header": "\nt,px,py,pz", "rows": ["0,0,0,1", "1,0,0"]}, "in line 2 has 4"),
        (
            {"header": "t;px;py;pz", "rows": ["0;0;0;1"]},
            "line 1: ';' separates the columns; commas",
        ),
        ({"header": "t\tpx\tpy\tpz", "rows": []}, "line 1: a tab separates the columns"),
        ({"header": "", "rows": []}, "empty; a header expected"),
        ({"header": 't,"px', "rows": []}, "line 2: not valid CSV: unexpected end of data"),
        ({"header": "t,px,py,pz,u_1,u_1", "rows": []}, "line 1: column u_1 is there twice"),
        (
            {"header": "t,px,py,pz", "rows": ["0,0,0,1", "5e6,0,0,1"]},
            "column t: 5e[+]06 s, or 1.39e[+]03 h, is too long: 3600 s is possible; .* seconds",
        ),
    ],
)
def test_bad_csv_is_refused_naming_line_and_column(tmp_path, changes, reason):
    with pytest.raises(ScenarioError, match=reason):
        load_scenario(csv_file(tmp_path, **changes))


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("µs", 1e6)])
def test_times_in_another_unit_show_in_the_velocities(tmp_path, unit, factor):
    times = np.linspace(0.0, 3.0, 31)
    if unit == "µs":
        times = times / 1e3  # 3 ms: in µs as short as the flight of the other case
    speed = 1.0 if unit == "ms" else 1e3
    rows = [f"{t * factor:.6f},{speed * t:.6f},0,1,{speed},0,0" for t in times]
    file = csv_file(tmp_path, header="t,px,py,pz,vx,vy,vz", rows=rows)
    with pytest.raises(ScenarioError, match=f"line 1: t is in {unit}, .*; seconds expected"):
        load_scenario(file)


def test_a_byte_order_mark_spaces_and_an_upper_case_ending_are_read(tmp_path):
    text = "t, px, py, pz\n0, 0, 0, 1\n\n1, 0, 0, 1\n"
    scenarios = []
    for name, encoding in (("plain.csv", "utf-8"), ("marked.CSV", "utf-8-sig")):
        (tmp_path / name).write_text(text, encoding=encoding)
        scenarios.append(load_scenario(str(tmp_path / name)))
    plain, marked = (one.route.path.last for one in scenarios)
    np.testing.assert_array_equal(plain, marked)


def test_a_file_that_is_no_utf_8_is_refused(tmp_path):
    file = tmp_path / "latin.csv"
    file.write_bytes("t,px,py,pz,Höhe\n".encode("latin-1"))
    with pytest.raises(ScenarioError, match=r"latin.csv: not a text in UTF-8"):
        load_scenario(str(file))


def test_a_jump_has_no_smooth_curve(tmp_path):
    rows = [f"{0.01 * i:.2f},{float(i > 50)},0,1" for i in range(100)]
    with pytest.raises(ScenarioError, match=r"line 5\d column px: no smooth curve passes within"):
        load_scenario(csv_file(tmp_path, "t,px,py,pz", rows))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(0.02, 0.5), min_size=3, max_size=40),
    st.floats(0.2, 3.0),
    st.integers(0, 2),
)
def test_every_sample_is_met(steps, rate, given_rows):
    times = np.append(0.0, np.cumsum(steps))
    table = circle(times, rate)
    rows = [table[:, 1:4], table[:, 5:8], table[:, 8:11]]
    group = CurveSamples(*rows[: given_rows + 1])
    try:
        (path,) = fitted(times, [group], 1e-3)
    except Misfit:
        pytest.fail("a smooth curve is met")
    inside = path.rows(np.clip(times, 1e-9, times[-1] - 1e-9))
    assert np.abs(inside[0] - table[:, 1:4]).max() <= 1.1e-3


@pytest.mark.parametrize("times", [(0.0, 0.7), (0.0, 0.5, 0.7), (0.0, 0.5, 0.5625, 0.59375)])
def test_between_few_samples_the_curve_goes_straight_on(times):
    """Of a line: as many samples as leave the rates of a spline open."""
    times = np.array(times)
    (path,) = fitted(times, [CurveSamples(np.stack([2.0 * times, 1.0 - times], 1))], 1e-3)
    within = np.linspace(0.0, times[-1], 50)
    found = path.rows(within)
    np.testing.assert_allclose(found[0], np.stack([2.0 * within, 1.0 - within], 1), atol=1e-5)
    np.testing.assert_allclose(found[2], 0.0, atol=1e-2)


PLAIN = "t,px,py,pz"
SQUARE = ("0,0,0,1", "2,1,0,1", "4,1,1,1", "6,0,1,1", "8,0,0,1")


def flown(folder, rows, header=PLAIN):
    path = trajectory_of(load_scenario(csv_file(folder, header, rows)))
    return path.rows(np.linspace(0.0, path.length, 500))[0]


def test_two_rows_far_apart_are_a_straight_way_with_the_arm_at_rest(tmp_path):
    found = flown(tmp_path, ("0,0,0,1", "8,1,0,1"))
    np.testing.assert_allclose(found[:, 0], np.linspace(0.0, 1.0, 500), atol=1e-6)
    np.testing.assert_allclose(found[:, 1:], np.tile(found[0, 1:], (500, 1)), atol=1e-9)


def test_a_long_pause_of_a_dense_file_is_a_pause(tmp_path):
    rest = np.arange(0.0, 5.0, 0.1)
    rows = [f"{t:.1f},0,0,1" for t in rest] + [f"{t + 65:.1f},0,0,1" for t in rest]
    np.testing.assert_allclose(flown(tmp_path, rows)[:, :3], [[0.0, 0.0, 1.0]] * 500, atol=1e-9)


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        (
            (*SQUARE, "20,0,.01,1"),
            "line 7 column p[xy]: 12 s after line 6, and the smooth curve",
        ),
        (("0,0,0,1", "10,.01,0,1", "10.1,.05,0,1", "10.2,.2,0,1", "10.3,.45,0,1"), "line 3 column"),
    ],
)
def test_rows_between_which_the_curve_swings_out_are_refused(tmp_path, rows, reason):
    with pytest.raises(ScenarioError, match=reason) as error:
        flown(tmp_path, rows)
    assert "give rows between them" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("per_turn", [3, 4, 6])
def test_few_rows_of_a_circle_and_of_a_swing_are_flown(tmp_path, per_turn):
    turn = 2.0 * np.pi / per_turn * np.arange(4 * per_turn)
    times = 6.0 / per_turn * np.arange(4 * per_turn)
    round_about = np.column_stack([times, np.cos(turn), np.sin(turn), 0.0 * turn + 1.5])
    to_and_fro = np.column_stack([times, 2.0 * np.cos(turn + 0.5), 0.0 * turn, 0.0 * turn + 1.5])
    assert np.abs(flown(tmp_path, text(round_about))[:, :2]).max() < 1.05
    assert np.abs(flown(tmp_path, text(to_and_fro))[:, 0]).max() < 2.3
    assert len(flown(tmp_path, SQUARE))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31), count=st.integers(1, 12))
def test_long_gaps_are_solved_as_by_singular_values(seed, count):
    random = np.random.default_rng(seed)
    n, width = count + 7, 8
    first = np.sort(np.concatenate([np.arange(count), random.integers(0, count, 3 * n)]))
    band, target = random.normal(size=(len(first), width)), random.normal(size=(len(first), 2))
    whole = np.zeros((len(first), n))
    for row, j, part in zip(whole, first, band, strict=True):
        row[j : j + width] = part
    expected = np.linalg.lstsq(whole, target)[0]
    np.testing.assert_allclose(least_squares(csc_matrix(whole), target), expected, atol=1e-6)


@pytest.mark.parametrize("field", ["1_0", "٣", "0x1", "nan", "1e400", "\x000.5", "0,5"])
def test_a_field_that_other_programs_read_otherwise_is_refused(tmp_path, field):
    rows = ["0,0,0,1", f'1,"{field}",0,1', "2,0,0,1"]
    with pytest.raises(ScenarioError, match="line 3 column px: .* is not a finite number"):
        load_scenario(csv_file(tmp_path, "t,px,py,pz", rows))


def test_a_value_beyond_every_room_is_refused_before_the_fit(tmp_path):
    rows = ["0,0,0,1", "1,1e308,0,1", "2,0,0,1"]
    with pytest.raises(ScenarioError, match="line 3 column px: beyond 1e"):
        load_scenario(csv_file(tmp_path, "t,px,py,pz", rows))


def test_times_in_ms_of_a_short_race_show_in_its_speed(tmp_path):
    times = np.linspace(0.0, 3.0, 61)
    table = np.column_stack([times, race(times, 5.0)])[:, :4]
    table[:, 0] *= 1e3
    with pytest.raises(ScenarioError, match="3000 s, but never faster than 0.005 m/s.*in seconds"):
        load_scenario(csv_file(tmp_path, "t,px,py,pz", text(table)))


PICK = (  # t, x, z, magnet: descent to a pause, pick, climb, way, drop at a pause, way
    (0, -1, 1.00, 0),
    (2, -1, 0.94, 0),
    (2.6, -1, 0.94, 1),
    (3.2, -1, 0.94, 1),
    (4.2, -1, 1.00, 1),
    (8.2, 1, 1.00, 1),
    (9.2, 1, 1.00, 0),
    (10.2, 1, 1.00, 0),
    (12, 0, 1.00, 0),
)


def picked(folder, rows=PICK, name="magnet", options=None):
    lines = [f"{t},{x},0,{z},{on}" for t, x, z, on in rows]
    return load_scenario(csv_file(folder, f"t,px,py,pz,{name}", lines), options=options)


@pytest.mark.parametrize("name", ["magnet", "gripper"])
def test_a_trajectory_picks_and_drops(tmp_path, name):
    scenario = picked(tmp_path, name=name)
    begin = scenario.trajectory_begins
    assert scenario.magnet == ((begin + 2.6, True), (begin + 9.2, False))
    (window,) = grasp_windows(scenario.motions, scenario.magnet)
    assert window.back == pytest.approx((0.0, 0.0, 0.06))
    times = np.array([window.descent, window.grip, window.lifted, window.release]) - begin
    assert times == pytest.approx([0.0, 2.6, 4.2, 9.2])
    assert window.departure - begin == pytest.approx(10.2)
    assert scenario.payload_mass == 0.2
    assert scenario.notes == ()


def test_it_picks_later_where_it_is_slowed_down(tmp_path):
    scenario = picked(tmp_path, options=ScenarioOptions(slowdown=2.0))
    begin = scenario.trajectory_begins
    assert scenario.magnet == ((begin + 5.2, True), (begin + 18.4, False))
    (window,) = grasp_windows(scenario.motions, scenario.magnet)
    assert window.lifted - begin == pytest.approx(8.4)


def test_a_pause_is_a_rest(tmp_path):
    """Between the rows of a pause the curve stays within 1 mm; the file has no row there."""
    path = trajectory_of(picked(tmp_path))
    rows = path.rows(np.linspace(9.3, 10.1, 30), 2)
    assert np.abs(rows[0, :, :3] - (1.0, 0.0, 1.0)).max() < 1e-3
    assert np.abs(rows[1, :, :3]).max() < 0.02


def test_an_error_behind_a_pause_names_its_line(tmp_path):
    rows = (*PICK[:-1], (12, 0, -1.0, 0))
    with pytest.raises(ScenarioError, match=r"line 10.*pz.*below the ground"):
        picked(tmp_path, rows)


def test_a_pick_without_a_descent_is_told(tmp_path):
    rows = ((0, 0, 1, 0), (2, 1, 1, 1), (4, 2, 1, 0), (6, 3, 1, 0))
    assert "a pick is judged only with a descent" in picked(tmp_path, rows).notes[0]
    quiet = tuple((t, x, z, 0) for t, x, z, _ in PICK)
    assert picked(tmp_path, quiet).magnet == () and picked(tmp_path, quiet).payload_mass == 0.0


@pytest.mark.parametrize(
    ("row", "said"), [((0, -1, 1, 1), "1: 0 expected in the first"), ((0, -1, 1, 0.5), "0 or 1")]
)
def test_a_magnet_is_on_or_off(tmp_path, row, said):
    rows = (row, *PICK[1:]) if row[3] == 1 else (*PICK[:1], (1, -1, 1, 0.5), *PICK[1:])
    with pytest.raises(ScenarioError, match=said):
        picked(tmp_path, rows)
