"""What `paper.py` found: its ratios and goals, its tables for docs/figures.md, its pictures by matplotlib."""

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
"""The figure's number in the paper, the scenario's name there, and what it is."""
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
JUDGED, MAX_SIZE = 16 * 1024, 8192 * 1024
TOKENS = ROOT / "resources" / "theme" / "tokens.json"
FONTS = ROOT / "resources" / "fonts"
MARKS = "osD^vPX<>*h"
MORE_COLOURS = ("run", "warn", "stop", "running")
"""Of the theme, for rows beyond its series."""

Found = Mapping[str, Any]


class Goal(NamedTuple):
    """A ratio of medians beside the most that it may be; `again` is plain's to itself at the same sizes."""

    what: str
    ratio: float
    most: float
    again: float

    @property
    def is_reached(self) -> bool:
        """Whether it is, and counts."""
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
        """The sizes that were measured, from small to large."""
        return sorted({size for _, of, size in self._cells if of == kind})

    def cell(self, row: str, kind: str, size: int) -> Found | None:
        """What was found there, if anything."""
        return self._cells.get((row, kind, size))

    def ratio(self, row: str, other: str, kind: str, size: int) -> float | None:
        """The median of `row` ÷ that of `other`."""
        one, two = self.cell(row, kind, size), self.cell(other, kind, size)
        return one["median_ms"] / two["median_ms"] if one and two else None

    def counts(self, kind: str, size: int) -> bool:
        """Whether plain differs from itself by no more than 5 % there."""
        again = self.ratio(AGAIN, PLAIN, kind, size)
        return again is not None and is_trusted(again)

    def mean_ratio(self, row: str, other: str, kind: str, sizes: Iterable[int]) -> float | None:
        """The geometric mean of the ratios at these sizes; None when one of them is not known."""
        ratios = [self.ratio(row, other, kind, size) for size in sizes]
        known = [math.log(each) for each in ratios if each is not None]
        return math.exp(statistics.fmean(known)) if known and len(known) == len(ratios) else None


def scenarios(found: Found) -> list[Scenario]:
    """The scenarios of a run, in the order of the paper's figures."""
    return sorted(map(Scenario, found["scenarios"]), key=lambda each: each.number)


def goals(found: Found) -> list[Goal]:
    """The goals for texts beside plain pyzmq on one computer, as far as they were measured."""
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
            continue  # a part of them says nothing of the mean
        ratio = local.mean_ratio(NEP, PLAIN, kind, sizes)
        again = local.mean_ratio(AGAIN, PLAIN, kind, sizes)
        if ratio is not None and again is not None:
            goals.append(Goal(what, ratio, goal, again))
    return goals


def does_count(found: Found) -> bool:
    """Whether plain differs from itself by no more than 5 % in the mean of each scenario and kind."""
    means = [
        scenario.mean_ratio(AGAIN, PLAIN, kind, scenario.sizes(kind))
        for scenario in map(Scenario, found["scenarios"])
        for kind in scenario.kinds
    ]
    return bool(means) and all(mean is not None and is_trusted(mean) for mean in means)


# ---- words ----------------------------------------------------------------------------------------


def size_text(size: int) -> str:
    """As in "64 kB", which are 65536 bytes."""
    return f"{size // 1024} kB" if size < 1 << 20 else f"{size >> 20} MB"


def ms_text(ms: float) -> str:
    """Three figures."""
    return f"{ms:.0f}" if ms >= 100 else f"{ms:.1f}" if ms >= 10 else f"{ms:.2f}" if ms >= 1 else f"{ms:.3f}"


def times(ratio: float) -> str:
    """As in "0.97" or "120" times."""
    return f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.1f}" if ratio >= 1.95 else f"{ratio:.2f}"


def cell_text(cell: Found | None) -> str:
    """Its median and p95."""
    return f"{ms_text(cell['median_ms'])} ({ms_text(cell['p95_ms'])})" if cell else ""


def table(scenario: Scenario, kind: str) -> str:
    """Medians and p95 of a kind in Markdown."""
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
    """How many times nep's median each row takes, in words; empty without nep."""
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
    """When, where and with what it was taken."""
    of = scenario["computer"]
    with_what = ", ".join(f"{name} {version}" for name, version in scenario["versions"].items())
    load = f", load {of['load_before']} before it" if of["load_before"] is not None else ""
    return (
        f"Taken on {scenario['taken']}: {of['processor']}, {of['processors']} processors, "
        f"{of['system']}{load}. {with_what}."
    )


def section(scenario: Scenario) -> str:
    """A scenario's tables and what belongs to them."""
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
    """All of it in Markdown; `pictures` is the folder of the figures, seen from the document."""
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
    """Write tables, pictures and numbers of a run into the documentation; return the written files.

    Scenarios that it doesn't have stay as they were.
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


# ---- pictures -------------------------------------------------------------------------------------


def draw(found: Found, folder: Path) -> list[Path]:
    """A figure of each scenario, as SVG and PNG."""
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
    """A panel for each kind, and what the lines are below them."""
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
    """A row's medians with bars up to p95; hollow marks where it does not count."""
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
    """Its axes."""
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
