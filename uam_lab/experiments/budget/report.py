"""The budgets of a tick as a table, as JSON and as stacked bars."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from uam_control.settings.atomic import write_text
from uam_lab.experiments.budget.flown import Budget
from uam_lab.experiments.budget.path import SEGMENTS
from uam_lab.records.results.result_folder import write_json
from uam_lab.records.results.templates import markdown_table, shown
from uam_lab.report.figures import style

# share of the ticks in each panel, and its title
PANELS = ((1.0, "mean of all ticks"), (0.01, "mean of the slowest 1 %"))
INKS = ("#c9d1d8", "#1f5fa8", "#2a9d8f", "#d9822b", "#7b6bb0", "#a63d57")
COLOURS = dict(zip(SEGMENTS, INKS, strict=True))
HEAD = ("layout", "p50", "p99", "p99.9", "max", "missed", "cores", "pace")


def summary(budgets: Sequence[Budget]) -> str:
    """Return Markdown: the latencies of each layout, then its path, then the work per tick."""
    parts = [
        "Latency [ms] from the sensors' publication to the setpoint's; missed: later than three "
        "control periods; cores: of the nodes that fly; pace: simulated per wall time.",
        markdown_table(HEAD, map(_totals, budgets)),
    ]
    for one in budgets:
        mean = one.path.mean()
        rows = [*zip(one.path.nodes, mean, strict=True), ("sum", mean.sum(axis=0))]
        names = list(next(iter(one.work.values())))
        parts += [
            f"## {one.layout}",
            "Way of a tick [ms], mean of all ticks:",
            markdown_table(
                ("node", *SEGMENTS, "sum"),
                ([node, *(f"{t:.3f}" for t in (*times, times.sum()))] for node, times in rows),
            ),
            "Work per tick [ms], on the way or not, and cores in flight:",
            markdown_table(
                ("node", *names, "cores"),
                (
                    [node, *(f"{work[name]:.3f}" for name in names), shown(one.cores.get(node), 3)]
                    for node, work in one.work.items()
                ),
            ),
        ]
        if one.failure:
            parts.append(f"The flight was not completed: {one.failure}.")
    return "\n\n".join(parts) + "\n"


def _totals(one: Budget) -> list[str]:
    missed = f"{one.missed} of {one.ticks} ({100.0 * one.missed_share:.3f} %)"
    return [
        one.layout,
        *(f"{value:.2f}" for value in one.figures.values()),
        missed if one.clock == "realtime" else "-",
        shown(one.control_cores if one.cores else None, 2),
        f"{one.pace:.3f}",
    ]


def document(budgets: Sequence[Budget], facts: dict[str, Any]) -> dict[str, Any]:
    """Return the content of budget.json; times in ms."""
    return facts | {
        "layouts": {
            one.layout: {
                "clock": one.clock,
                "latency_ms": one.figures,
                "missed_ticks": one.missed,
                "ticks": one.ticks,
                "missed_share": one.missed_share,
                "pace": one.pace,
                "control_cores": one.control_cores,
                "cores": one.cores,
                "path_ms": {
                    title: {
                        node: dict(zip(SEGMENTS, times.tolist(), strict=True))
                        for node, times in zip(one.path.nodes, one.path.mean(share), strict=True)
                    }
                    for share, title in PANELS
                },
                "work_ms": one.work,
                "failure": one.failure,
                "flight": one.folder.name,
            }
            for one in budgets
        }
    }


def write(out: Path, budgets: Sequence[Budget], facts: dict[str, Any]) -> None:
    """Write summary.md, budget.json and budget.png."""
    write_text(out / "summary.md", summary(budgets))
    write_json(out / "budget.json", document(budgets, facts))
    with style.styled():
        style.save(picture(budgets), out / "budget.png")


def picture(budgets: Sequence[Budget]) -> Figure:
    """Draw the way of a tick: a panel per share of the ticks, a stacked bar per layout and node."""
    bars = sum(len(one.path.nodes) + 1 for one in budgets)
    figure = Figure(figsize=(style.WIDTH, 1.5 + 0.28 * bars))
    height = figure.get_figheight()
    panels = figure.subplots(1, len(PANELS), sharey=True)
    for axis, (share, title) in zip(panels, PANELS, strict=True):
        _stack(axis, budgets, share)
        axis.set_title(title, loc="left", fontsize=9.0)
        axis.set_xlabel("ms")
    panels[0].invert_yaxis()
    handles = [style.key(name, colour, width=6.0) for name, colour in COLOURS.items()]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles))
    figure.subplots_adjust(
        left=0.2, right=0.985, top=1.0 - 0.6 / height, bottom=0.75 / height, wspace=0.06
    )
    style.title(figure, "From the sensors to the setpoint")
    return figure


def _stack(axis: Axes, budgets: Sequence[Budget], share: float) -> None:
    """Draw the bars of one panel; those of the nodes begin where the one before ends."""
    labels: list[str] = []
    for one in budgets:
        mean = one.path.mean(share)
        _bar(axis, len(labels), 0.0, mean.sum(axis=0))
        axis.text(mean.sum(), len(labels), f" {mean.sum():.2f}", va="center", fontsize=8.0)
        labels.append(f"{one.layout}: sum")
        begin = 0.0
        for node, times in zip(one.path.nodes, mean, strict=True):
            _bar(axis, len(labels), begin, times)
            begin += times.sum()
            labels.append(node)
    longest = max(one.path.mean(share).sum() for one in budgets)
    axis.set_xlim(0.0, 1.12 * longest)  # with room for the sums
    axis.set_yticks(range(len(labels)), labels)
    axis.grid(visible=False, axis="y")


def _bar(axis: Axes, row: int, begin: float, times: Sequence[float]) -> None:
    for name, value in zip(SEGMENTS, times, strict=True):
        axis.barh(row, value, left=begin, height=0.72, color=COLOURS[name])
        begin += value
