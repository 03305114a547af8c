"""Results of `paper.py`: ratios and goals, tables for docs/figures.md, and plots with matplotlib."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from blocks import TRUSTED, is_trusted
from paper_ends import ENDS, KINDS
from paper_original import ROW as ORIGINAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
AGAIN, PLAIN, NEP = "plain again", "plain pyzmq", "nep"
ROWS = (*ENDS, ORIGINAL)
TITLES = {
    "remote": (9, "R-remote", "two programs, joined by a link with a Wi-Fi's delay and rate"),
    "local": (10, "L-local", "two programs on one computer"),
}
"""Number of the figure in the paper, name of the scenario there, and its description."""
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
JUDGED, MAX_SIZE = 16 * 1024, 8192 * 1024
TOKENS = ROOT / "resources" / "theme" / "tokens.json"
FONTS = ROOT / "resources" / "fonts"
MARKS = "osD^vPX<>*h"
MORE_COLOURS = ("run", "warn", "stop", "running")
"""Theme colours for rows beyond the theme's series."""

Found = Mapping[str, Any]


class Goal(NamedTuple):
    """Ratio of medians and its upper limit; `again` is the ratio of plain to itself at the same sizes."""

    what: str
    ratio: float
    most: float
    again: float

    @property
    def is_reached(self) -> bool:
        """True if the ratio is within its limit and the measurement counts."""
        return self.ratio <= self.most and is_trusted(self.again)

    def __str__(self) -> str:
        said = "reached" if self.is_reached else "**missed**" if is_trusted(self.again) else "does not count"
        return f"{self.what}: {self.ratio:.2f}, goal at most {self.most:.2f}, A/A {self.again:.2f}: {said}"


class Scenario:
    """The cells of one scenario."""

    def __init__(self, found: Found) -> None:
        self.found = found
        self.number, self.title, self.what = TITLES[found["name"]]
        self._cells = {(each["row"], each["kind"], each["size"]): each for each in found["cells"]}
        there = {row for row, _, _ in self._cells}
        self.rows = [row for row in ROWS if row in there]
        self.kinds = [kind for kind in KINDS if self.sizes(kind)]

    def sizes(self, kind: str) -> list[int]:
        """Return the measured sizes, in ascending order."""
        return sorted({size for _, of, size in self._cells if of == kind})

    def cell(self, row: str, kind: str, size: int) -> Found | None:
        """Return the measured cell, or None."""
        return self._cells.get((row, kind, size))

    def ratio(self, row: str, other: str, kind: str, size: int) -> float | None:
        """Return the median of `row` ÷ that of `other`, or None if one of them was not measured."""
        one, two = self.cell(row, kind, size), self.cell(other, kind, size)
        return one["median_ms"] / two["median_ms"] if one and two else None

    def counts(self, kind: str, size: int) -> bool:
        """Return True if two series of plain pyzmq differ by at most 5 % at this size."""
        again = self.ratio(AGAIN, PLAIN, kind, size)
        return again is not None and is_trusted(again)

    def mean_ratio(self, row: str, other: str, kind: str, sizes: Iterable[int]) -> float | None:
        """Return the geometric mean of the ratios at these sizes, or None if one of them was not measured."""
        ratios = [self.ratio(row, other, kind, size) for size in sizes]
        known = [math.log(each) for each in ratios if each is not None]
        return math.exp(statistics.fmean(known)) if known and len(known) == len(ratios) else None


def scenarios(found: Found) -> list[Scenario]:
    """Return the scenarios of a run, in the order of the paper's figures."""
    return sorted(map(Scenario, found["scenarios"]), key=lambda each: each.number)


def goals(found: Found) -> list[Goal]:
    """Return the measured goals: strings and JSON relative to plain pyzmq on one computer."""
    local = next((Scenario(each) for each in found["scenarios"] if each["name"] == "local"), None)
    if local is None:
        return []
    text = "`json` of one text ÷ plain pyzmq with the json module"
    asked = (
        ("`string` ÷ plain pyzmq with the same text, 16 kB to 8 MB", "string", (JUDGED, MAX_SIZE), 1.1),
        (f"{text}, 16 kB to 4 MB", "json", (JUDGED, MAX_SIZE // 2), 0.5),
        (f"{text}, 8 MB", "json", (MAX_SIZE, MAX_SIZE), 0.6),
    )
    goals = []
    for what, kind, (least, most), goal in asked:
        sizes = [size for size in local.sizes(kind) if least <= size <= most]
        if not {least, most} <= set(sizes):
            continue  # the mean of a part of the sizes isn't comparable
        ratio = local.mean_ratio(NEP, PLAIN, kind, sizes)
        again = local.mean_ratio(AGAIN, PLAIN, kind, sizes)
        if ratio is not None and again is not None:
            goals.append(Goal(what, ratio, goal, again))
    return goals


def does_count(found: Found) -> bool:
    """Return True if the means of both plain series differ by at most 5 % in each scenario and kind."""
    means = [
        scenario.mean_ratio(AGAIN, PLAIN, kind, scenario.sizes(kind))
        for scenario in map(Scenario, found["scenarios"])
        for kind in scenario.kinds
    ]
    return bool(means) and all(mean is not None and is_trusted(mean) for mean in means)


# ---- text -----------------------------------------------------------------------------------------


def size_text(size: int) -> str:
    """Format a size in bytes, for example 65536 as "64 kB"."""
    return f"{size // 1024} kB" if size < 1 << 20 else f"{size >> 20} MB"


def ms_text(ms: float) -> str:
    """Format milliseconds with at most three decimals, fewer for larger values."""
    return f"{ms:.0f}" if ms >= 100 else f"{ms:.1f}" if ms >= 10 else f"{ms:.2f}" if ms >= 1 else f"{ms:.3f}"


def times(ratio: float) -> str:
    """Format a ratio as "0.97" or "120", for example."""
    return f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.1f}" if ratio >= 1.95 else f"{ratio:.2f}"


def cell_text(cell: Found | None) -> str:
    """Format the median and p95 of a cell; empty without one."""
    return f"{ms_text(cell['median_ms'])} ({ms_text(cell['p95_ms'])})" if cell else ""


def table(scenario: Scenario, kind: str) -> str:
    """Return a Markdown table of the medians and p95 of a kind."""
    rows = scenario.rows
    lines = [f"| `{kind}` | {' | '.join(rows)} | A/A | |", f"|---:|{'---:|' * len(rows)}---:|---|"]
    for size in scenario.sizes(kind):
        texts = [cell_text(scenario.cell(row, kind, size)) for row in rows]
        again = scenario.ratio(AGAIN, PLAIN, kind, size)
        shown = "" if again is None else f"{again:.2f}"
        doubt = "" if scenario.counts(kind, size) else "does not count"
        lines.append(f"| {size_text(size)} | {' | '.join(texts)} | {shown} | {doubt} |")
    return "\n".join(lines)


def times_text(scenario: Scenario) -> str:
    """Return a Markdown list of each row's ratio to nep's median; empty without nep."""
    said = []
    for row in scenario.rows:
        if row == NEP:
            continue
        spans = []
        for kind in scenario.kinds:
            ratios = [scenario.ratio(row, NEP, kind, size) for size in scenario.sizes(kind)]
            known = [each for each in ratios if each is not None]
            if known:
                spans.append(f"`{kind}` {times(min(known))} to {times(max(known))}")
        if spans:
            said.append(f"- {row}: {', '.join(spans)}")
    return "\n".join(["Times the median of nep, least and most of all sizes:", "", *said]) if said else ""


def head(scenario: Found) -> str:
    """Return the date, computer and versions of a measurement as a sentence."""
    of = scenario["computer"]
    with_what = ", ".join(f"{name} {version}" for name, version in scenario["versions"].items())
    load = f", load {of['load_before']} before it" if of["load_before"] is not None else ""
    return (
        f"Taken on {scenario['taken']}: {of['processor']}, {of['processors']} processors, "
        f"{of['system']}{load}. {with_what}."
    )


def section(scenario: Scenario) -> str:
    """Return the Markdown section of a scenario: its conditions, tables and ratios."""
    trips = [each["trips"] for each in scenario.found["cells"]]
    measured = f"{min(trips)} to {max(trips)} trips a figure" if trips else "nothing was measured"
    parts = [
        f"### Figure {scenario.number}: {scenario.title}, {scenario.what}",
        head(scenario.found),
        f"Link: {scenario.found['link']}. Blocks: {scenario.found['blocks']}; {measured}.",
    ]
    told = scenario.found.get("link_told")
    if told:
        parts.append(
            f"{told['packets']} packets passed the link, {told['dropped']} of them were dropped; they came "
            f"{told['late_p95_ms']:.2f} ms (p95) later than they should."
        )
    parts += [table(scenario, kind) for kind in scenario.kinds]
    parts += [f"- {row}: not run, {why}" for row, why in scenario.found["not_run"].items()]
    return "\n\n".join([*parts, *filter(None, [times_text(scenario)])])


def report(found: Found, pictures: str = "") -> str:
    """Return the whole report in Markdown.

    `pictures` is the folder of the figures relative to the document; without it, there are no figures.
    """
    parts = [
        (
            "Milliseconds for a round trip: median (p95). A/A is plain pyzmq against itself; "
            f"where it is off by more than {TRUSTED:.0%} the line does not count."
        )
    ]
    parts += [f"{TITLES[name][1]}: not run, {why}" for name, why in found["not_run"].items()]
    for scenario in scenarios(found):
        if pictures:
            name = f"figure-{scenario.number}"
            parts.append(f"![{scenario.title}: round trips by size]({pictures}/{name}.svg)")
        parts.append(section(scenario))
    reached = goals(found)
    if reached:
        parts += ["### Goals", "\n".join(f"- {goal}" for goal in reached)]
    return "\n\n".join(parts)


def write(found: Found, docs: Path) -> list[Path]:
    """Write tables, plots and numbers of a run to the documentation; return the written files.

    Results of scenarios that are not in this run are kept.
    """
    figures = docs / "figures.json"
    if figures.exists():
        names = {each["name"] for each in found["scenarios"]}
        kept = json.loads(figures.read_text(encoding="utf-8"))
        scenarios = [each for each in kept["scenarios"] if each["name"] not in names] + found["scenarios"]
        measured = {each["name"] for each in scenarios}
        not_run = {name: why for name, why in found["not_run"].items() if name not in measured}
        found = {"scenarios": scenarios, "not_run": not_run}
    document = docs / "figures.md"
    text = document.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    document.write_text(f"{before}{BEGIN}\n\n{report(found, 'images')}\n\n{END}{after}", encoding="utf-8")
    figures.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return [document, figures, *draw(found, docs / "images")]


# ---- figures --------------------------------------------------------------------------------------


def draw(found: Found, folder: Path) -> list[Path]:
    """Draw a figure for each scenario as SVG and PNG; return the written files."""
    import matplotlib as mpl  # noqa: PLC0415 - it takes long, and only those who draw need it
    from matplotlib import font_manager  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    for path in sorted(FONTS.glob("Inter-*.otf")):
        font_manager.fontManager.addfont(path)
    colours = json.loads(TOKENS.read_text(encoding="utf-8"))["colour"]["light"]
    written = []
    style = {
        "font.family": "Inter", "font.size": 10, "svg.hashsalt": "nep", "text.color": colours["text"],
        "axes.labelcolor": colours["textSecondary"], "xtick.color": colours["textSecondary"],
        "ytick.color": colours["textSecondary"], "axes.edgecolor": colours["borderStrong"],
        "grid.color": colours["border"], "axes.facecolor": colours["panel"],
        "savefig.facecolor": colours["panel"],
    }  # fmt: skip
    with mpl.rc_context(style):
        for scenario in scenarios(found):
            figure = Figure(figsize=(12, 5), layout="constrained")
            plot(figure, scenario, colours)
            for ending, metadata in (("svg", {"Date": None}), ("png", {"Software": None})):
                path = folder / f"figure-{scenario.number}.{ending}"
                figure.savefig(path, dpi=110, metadata=metadata)
                written.append(path)
    return written


def plot(figure: Figure, scenario: Scenario, colours: Mapping[str, Any]) -> None:
    """Plot a panel for each kind, with a legend below."""
    others = [row for row in ROWS if row != PLAIN]
    palette = dict(zip(others, (*colours["series"], *(colours[name] for name in MORE_COLOURS)), strict=True))
    palette[PLAIN] = colours["textTertiary"]
    panels = figure.subplots(1, len(scenario.kinds), sharey=True, squeeze=False)[0]
    for axes, kind in zip(panels, scenario.kinds, strict=True):
        for row in scenario.rows:
            line(axes, scenario, (row, kind), palette[row], MARKS[ROWS.index(row)])
        panel(axes, scenario, kind)
    panels[0].set_ylabel("round trip, ms (median; bar to p95)")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
    title = f"Figure {scenario.number} · {scenario.title}: {scenario.what}"
    figure.suptitle(title, x=0.01, ha="left", weight="semibold")
    doubt = f"hollow: does not count (A/A beyond {TRUSTED:.0%})"
    figure.text(0.99, 0.985, doubt, ha="right", va="top", color=colours["textTertiary"], fontsize=9)


def line(axes: Axes, scenario: Scenario, what: tuple[str, str], colour: str, mark: str) -> None:
    """Plot a row's medians with bars up to p95; sizes that do not count get hollow marks."""
    row, kind = what
    sizes = [size for size in scenario.sizes(kind) if scenario.cell(row, kind, size)]
    cells = [scenario.cell(row, kind, size) or {} for size in sizes]
    medians = [cell["median_ms"] for cell in cells]
    above = [max(0.0, cell["p95_ms"] - cell["median_ms"]) for cell in cells]
    is_nep = row == NEP
    axes.errorbar(
        sizes, medians, yerr=[[0.0] * len(sizes), above], fmt="none", ecolor=colour, elinewidth=1, alpha=0.45
    )
    axes.plot(
        sizes, medians, color=colour, marker=mark, markersize=5.5, label=row,
        linewidth=2.6 if is_nep else 1.5, linestyle="--" if row == PLAIN else "-", zorder=3 if is_nep else 2,
    )  # fmt: skip
    hollow = [n for n, size in enumerate(sizes) if not scenario.counts(kind, size)]
    axes.plot(
        [sizes[n] for n in hollow], [medians[n] for n in hollow], linestyle="none", marker=mark,
        markersize=5.5, markerfacecolor=axes.get_facecolor(), markeredgecolor=colour, zorder=4,
    )  # fmt: skip


def panel(axes: Axes, scenario: Scenario, kind: str) -> None:
    """Set up the axes of a kind."""
    sizes: Sequence[int] = scenario.sizes(kind)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_xticks(
        sizes, [size_text(size) for size in sizes], rotation=45, ha="right", rotation_mode="anchor"
    )
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(visible=True, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title(kind, loc="left", fontsize=11, weight="semibold")
    axes.set_xlabel("payload (1 kB is 1024 bytes)")
