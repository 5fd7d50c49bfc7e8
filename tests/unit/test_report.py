"""The page and the final table: their texts; the page loads no other file."""

import io
import json
import re

import numpy as np
import pytest

from uam_lab.cli.main import main
from uam_lab.records.results import timeseries
from uam_lab.records.results.terminal import Terminal
from uam_lab.report.build import build_report
from uam_lab.report.facts import flight_summary
from uam_lab.report.facts import parameter_table as parameters
from uam_lab.report.figures import figures
from uam_lab.report.page import console, pages
from uam_lab.report.video import flight_video


def text_of(html):
    """Return the text of a page without tags."""
    bare = re.sub(r"<(style|script).*?</\1>|<[^>]+>", " ", html, flags=re.S)
    return re.sub(r"\s+", " ", bare)


def change_metrics(folder, **changes):
    """Write metrics.json again with some entries changed."""
    file = folder / "metrics.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


def test_the_report_is_one_page_without_external_files(flight_folder, monkeypatch):
    for name in list(figures.FIGURES)[2:]:
        monkeypatch.delitem(figures.FIGURES, name)
    steps = []
    report = build_report(flight_folder, steps.append, pictures=False)
    html = re.sub(r"<script.*?</script>", "", report.page.read_text(), flags=re.S)
    assert report.page == flight_folder / "report.html"
    assert report.problem == ""
    assert steps[-1] == "page"
    assert html.count('src="data:image/png;base64,') == 2
    assert all(source.startswith("data:") for source in re.findall(r'src="([^"]*)', html))
    # links lead to a part of the page or to a file beside it
    links = re.findall(r'href="([^"]*)', html)
    assert "metrics.json" in links
    for link in links:
        part = f'id="{link[1:]}"' in html
        assert part if link.startswith("#") else (flight_folder / link).exists(), link
    assert not re.search(r"@import|url\(|<link|<script", html)


def test_the_page_shows_the_stability_analysis(flight_folder, monkeypatch):
    for name in list(figures.FIGURES):
        monkeypatch.delitem(figures.FIGURES, name)
    assert "Appendix" not in text_of(pages.write_page(flight_folder).read_text())
    build_report(flight_folder, pictures=False)
    found = json.loads((flight_folder / "stability.json").read_text())
    words = text_of((flight_folder / "report.html").read_text())
    assert "Stability proof (Appendix), checked along this flight" in words
    assert f"of {found['ticks']} airborne ticks" in words
    assert f"{found['arm']['xi_max']:.3g}" in words
    assert "spectral radius" in words


def test_the_page_shows_the_result_and_the_command(flight_folder):
    words = text_of(pages.write_page(flight_folder).read_text())
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    assert metrics["mission_completed"] is True
    assert "Mission completed" in words
    assert f"{metrics['rms']['attitude_deg'][1]:.2f}°" in words
    assert "0.050 m" in words
    assert "3.11°" in words
    assert "uam fly --engine direct --seed 1" in words
    assert f"numpy {np.__version__}" in words
    assert "from the take-off command to the touchdown command" in words
    assert words.count("better") == 8
    assert "latency" not in words


def test_the_page_shows_the_identified_thrust(flight_folder):
    found = {"end": 0.859, "least": 0.8586, "largest": 1.0}
    change_metrics(flight_folder, thrust_factor=found)
    words = text_of(pages.write_page(flight_folder).read_text())
    assert "0.859 of the assumed thrust at the end (0.859 to 1.000 in flight)" in words


def test_the_page_marks_errors_above_the_papers_and_shows_the_abort_reason(flight_folder):
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    metrics["rms"]["arm_deg"] = [1.19, 5.0]
    metrics["rms"]["position_m"][0] = None
    change_metrics(
        flight_folder,
        rms=metrics["rms"],
        shortfalls=["aborted: tilt <70>"],
        clock="realtime",
        latency_ms={"p50": 2.5, "p99": 10.25, "max": None},
        missed_ticks=7,
    )
    html = pages.write_page(flight_folder).read_text()
    words = text_of(html)
    assert "aborted: tilt &lt;70&gt;" in html
    assert (words.count("better"), words.count("equal"), words.count("worse")) == (5, 1, 1)
    assert "10.25 ms" in words
    assert "missed control ticks 7" in words


@pytest.mark.parametrize(
    ("changes", "headline"),
    [
        ({"mission_completed": False, "abort_reason": "tilt"}, "Mission aborted"),
        ({"scenario": "lemniscate"}, "Mission completed"),
    ],
)
def test_an_incomplete_flight_and_another_mission_are_not_compared(
    flight_folder, changes, headline
):
    change_metrics(flight_folder, **changes)
    words = text_of(pages.write_page(flight_folder).read_text())
    out = io.StringIO()
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    Terminal(file=out, width=100).print(console.summary(metrics))
    assert headline in words
    for text in (words, out.getvalue()):
        assert " ".join(text.split()).count("errors are not compared with those of the paper") == 1
        assert not any(word in text for word in ("better", "worse", "equal"))


def test_the_video_has_a_picture_before_it_plays(flight_folder, tmp_path):
    picture, video = tmp_path / "b.png", tmp_path / "flight.mp4"
    picture.write_bytes(b"picture")
    video.write_bytes(b"video")
    rendered = flight_video.Rendered((picture,), picture, video)
    html = pages.write_page(flight_folder, rendered).read_text()
    assert html.count('poster="data:image/png;base64,cGljdHVyZQ=="') == 1


def test_page_and_console_show_the_supervisors_interventions(flight_folder):
    steps = [
        {"time_s": 0.0, "from": "grounded", "to": "taking off", "cause": "armed"},
        {"time_s": 3.25, "from": "flying", "to": "holding", "cause": "tilt 0.90 rad"},
    ]
    assert flight_summary.supervision_story({"transitions": steps[:1]}) is None
    change_metrics(flight_folder, transitions=steps)
    words = text_of(pages.write_page(flight_folder).read_text())
    assert "3.250 s flying → holding tilt 0.90 rad" in words
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    assert flight_summary.supervision_story(metrics) == "holding at 3.2 s (tilt 0.90 rad)"


def test_the_page_names_every_safeguard_and_every_difference(flight_folder):
    file = flight_folder / "parameters.yaml"
    file.write_text(
        "position_controller:\n  ros__parameters:\n"
        "    lambda_1: [2.0, 2.0, 7.5]\n    epsilon: 0.0001\n"
        "    k_ceiling: [5.0, 5.0, 5.0, 5.0]\n    acceleration_limit: 0.0\n"
    )
    found = parameters.compare(file)
    rows = {row.name: row for row in found["controllers"]["position_controller"]}
    assert (rows["lambda_1"].flown, rows["lambda_1"].paper) == ("2, 2, 7.5", "2, 2, 4")
    assert rows["lambda_1"].differs
    assert not rows["epsilon"].differs
    assert found["safeguards"] == {"position_controller": ["k_ceiling = 5 (each)"]}
    words = text_of(pages.write_page(flight_folder).read_text())
    assert "position_controller: k_ceiling = 5 (each)" in words
    assert "No safeguard was on" not in words


def test_table_one_has_no_safeguard_and_no_difference_from_itself(tmp_path):
    from uam_control.settings import configuration

    found = parameters.compare(configuration.path("profiles/paper_table1.yaml"))
    assert found["safeguards"] == {}
    assert not any(row.differs for rows in found["controllers"].values() for row in rows)


def test_a_reconstructed_law_is_labelled_and_not_compared_with_table_one(flight_folder):
    from uam_control.settings import configuration

    file = configuration.path("profiles/asmc2.yaml")
    rows = {row.name: row for row in parameters.compare(file)["controllers"]["arm_controller"]}
    assert rows["varpi"].paper == "" and not rows["varpi"].differs  # varpi of another law
    assert rows["kappa"].description.startswith("kappa")
    assert rows["torque_max"].paper != ""
    (flight_folder / "parameters.yaml").write_text(file.read_text())
    clamps = {"position": 0, "attitude": 3, "arm": 12}
    change_metrics(flight_folder, controller="asmc2", clamps=clamps)
    words = text_of(pages.write_page(flight_folder).read_text())
    assert "controller ASMC-2 (reconstructed)" in words
    assert "controller asmc2" not in words and "flew as printed" not in words
    assert "position 0, attitude 3, arm 12" in words
    out = io.StringIO()
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    Terminal(file=out, width=100).print(console.summary(metrics))
    assert "ASMC-2 (reconstructed)" in out.getvalue()


def test_a_folder_with_little_in_it_still_gets_a_page(flight_folder):
    for name in ("parameters.yaml", "versions.json", "info.json"):
        (flight_folder / name).unlink()
    words = text_of(pages.write_page(flight_folder).read_text())
    assert "parameters.yaml" in words
    with pytest.raises(timeseries.UnreadableFlight):
        build_report(flight_folder.parent / "nothing")


def test_the_page_reports_a_missing_renderer(flight_folder):
    rendered = flight_video.Rendered(problem=flight_video.HOW_TO_GET_ONE)
    words = text_of(pages.write_page(flight_folder, rendered).read_text())
    assert "apt install libegl1 libgl1-mesa-dri" in words


def test_the_console_shows_the_same(flight_folder):
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    out = io.StringIO()
    Terminal(file=out, width=100).print(console.summary(metrics, flight_folder))
    lines = out.getvalue().splitlines()
    assert lines[0].strip() == "Mission completed"
    pitch = next(line for line in lines if "pitch" in line)
    assert f"{metrics['rms']['attitude_deg'][1]:.2f}°" in pitch
    assert "2.81°" in pitch
    assert "better" in pitch
    assert any("drop point" in line for line in lines)
    assert str(flight_folder) in "".join(line.strip() for line in lines)


def test_progress_without_a_terminal_is_a_line_per_kind_of_step():
    out = io.StringIO()
    with console.reporting(Terminal(file=out, force_terminal=False)) as progress:
        for step in ("figure path", "figure payload", "video 4 %", "video 8 %", "page"):
            progress(step)
    assert out.getvalue().splitlines() == [
        "report: figure path",
        "report: video 4 %",
        "report: page",
    ]


def test_notes_and_changes_of_the_vehicle_are_on_the_page(flight_folder):
    info = json.loads((flight_folder / "info.json").read_text())
    info |= {"notes": ["2 messages lost"], "vehicle_changes": {"air.wind": [2.0, 0.0, 0.0]}}
    (flight_folder / "info.json").write_text(json.dumps(info))
    words = text_of(pages.write_page(flight_folder).read_text())
    assert "Note: 2 messages lost" in words
    assert "air.wind 2.0, 0.0, 0.0" in words


def test_a_missing_info_is_no_error_and_a_damaged_file_is_one_line(
    flight_folder, monkeypatch, capsys
):
    for name in list(figures.FIGURES)[2:]:
        monkeypatch.delitem(figures.FIGURES, name)
    command = ["report", str(flight_folder), "--no-pictures"]
    (flight_folder / "info.json").unlink()
    assert main(command) == 0
    table, aside = flight_folder / "timeseries.parquet", flight_folder / "aside"
    table.rename(aside)
    capsys.readouterr()
    assert main(command) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"uam report: {table} does not exist"
    aside.rename(table)
    file = flight_folder / "metrics.json"
    for text, complaint in (
        ("{", "not valid JSON"),
        ("[]", "a mapping expected"),
        ('{"controller": "modular", "mission_completed": true, "duration_s": 1}', "rms is missing"),
    ):
        file.write_text(text)
        assert main(command) == 2
        assert capsys.readouterr().err == f"uam report: {file}: {complaint}\n"


def test_the_report_of_a_flight_without_a_log_in_another_folder(
    flight_folder, tmp_path, monkeypatch, capsys
):
    """As of the direct engine. The flight's folder stays as it is; another flight's is refused."""
    for name in list(figures.FIGURES)[2:]:
        monkeypatch.delitem(figures.FIGURES, name)
    before, again = sorted(flight_folder.iterdir()), tmp_path / "again"
    command = ["report", str(flight_folder), "--no-pictures", "--out"]
    assert main([*command, str(again)]) == 0
    assert (again / "report.html").exists() and (again / "metrics.json").exists()
    assert sorted(flight_folder.iterdir()) == before
    assert main([*command, str(again)]) == 2
    assert str(again) in capsys.readouterr().err


def test_the_log_stands_for_its_folder(tmp_path, capsys):
    assert main(["report", str(tmp_path / "log.mcap")]) == 2
    complaint = f"{tmp_path} has neither log.mcap nor metrics.json for a report"
    assert capsys.readouterr().err == f"uam report: {complaint}\n"


def test_outcomes_in_words():
    assert flight_summary.payload_story({"payload_lifted": None}) == "no payload in this flight"
    never = {"payload_lifted": None, "payload_mass_kg": 0.2}
    assert flight_summary.payload_story(never) == "the magnet was never on"
    absent = never | {"grasp": {"decisions": [{"text": "absent; payload at (5, 5, 0) m"}]}}
    assert flight_summary.payload_story(absent) == "absent; payload at (5, 5, 0) m"
    assert flight_summary.payload_story({"payload_lifted": False}) == "not lifted"
    story = {"payload_lifted": True, "payload_place_error_m": 0.034}
    assert flight_summary.payload_story(story) == "lifted, came to rest 3.4 cm from the drop point"
    assert flight_summary.landing_story({"landing_error_m": None}) == "not landed"
    assert (
        flight_summary.landing_story({"landing_error_m": 1.234}) == "1.23 m from the landing point"
    )


def test_a_long_name_of_a_phase_cuts_no_number(flight_folder):
    metrics = json.loads((flight_folder / "metrics.json").read_text())
    named = metrics | {"phases": [{**metrics["phases"][0], "phase": "to the far gate " * 8}]}
    said = []
    for one in (metrics, named):
        out = io.StringIO()
        Terminal(file=out, width=80).print(console.phase_table(one))
        assert "…" not in out.getvalue()
        said.append({word.strip() for word in re.split("[│┃\n]", out.getvalue())})
    rows = console.flight_summary.phase_rows(named)
    assert set(rows[0].texts[1:]) <= said[1]
