"""Tests of the window at many window and text sizes: no clipping or overlap, and Stop fully visible."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QPoint, QRect
from PySide6.QtWidgets import QWidget

from app import resources
from app.blocks.model.program import Problem
from app.ui.panels.base import Panel, PanelWidget
from app.ui.panels.home import RowHome
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.bars.app_bar import AppBar
from app.ui.shell.bars.run_bar import RunBar, ToolBar
from app.ui.shell.bars.status_bar import StatusBar
from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.dock_title import DockTitle, TitleTab
from app.ui.shell.docking.layouts import BEHAVIOUR
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.main_window import MainWindow
from app.ui.shell.start_page.page import read_examples
from app.ui.theme.theme import Mode, Theme
from app.ui.widgets import Chip, IconButton, StopButton
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.menus import geometry_beside_stop
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.shell_parts import Answers

pytest_plugins = ["tests.ui.shell_fixtures"]
SIZES = (
    (1024, 600),  # a projector, an old laptop
    (1093, 614),  # 1366 x 768 at 125 %
    (1366, 768),
    (1440, 900),
    (1920, 1080),
)
TILES, NAMES, NARROW = 52, 196, 760  # px: toolbox width (narrow, wide page); width limit of a narrow page
MIN_CANVAS = 420
SETTLE_MS, RESTS = 15, 3  # wait time, and waits without a moved widget until the layout is settled
# Stands in for the blocks panel, whose web view has its own tests.
HOME = (RowHome("behaviour", 0, 0, 626),)
BLOCKS = Panel(
    "behaviour", "Behaviour", "blocks", (), lambda context: PanelWidget(context, "Behaviour"), home=HOME
)


@pytest.fixture
def window(qtbot, theme: Theme) -> Iterator[MainWindow]:
    """Main window with the real panels, a robot and sample data."""
    panels = {**PanelRegistry(), "behaviour": BLOCKS}
    examples = read_examples(resources.folder() / "examples")
    made = MainWindow(Session.full(), theme, panels, examples, dialogs=Answers())
    qtbot.addWidget(made)
    theme.set_motion("on")
    made.show()
    yield made
    made.close()


def settle(qtbot, window: MainWindow) -> None:
    """Tick the window until its layout is stable; a layout pass can require another one."""
    rests, before = 0, places(window)
    while rests < RESTS:
        qtbot.wait(SETTLE_MS)
        window.tick()
        now = places(window)
        rests = rests + 1 if now == before else 0
        before = now
    QCoreApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest.value)  # for the last tick


def places(window: MainWindow) -> list[tuple[int, QRect]]:
    """Return the id and geometry of each visible widget."""
    return [(id(each), each.geometry()) for each in window.findChildren(QWidget) if each.isVisible()]


def place(widget: QWidget) -> QRect:
    return QRect(widget.mapTo(widget.window(), QPoint()), widget.size())


def stops(window: MainWindow) -> Iterator[str]:
    """Return the problems of the visible Stop buttons: missing, too small or partly outside the window."""
    seen = [stop for stop in window.findChildren(StopButton) if stop.isVisible()]
    if not any(stop.window() is window for stop in seen):
        yield "no Stop"
    for stop in seen:
        if stop.width() < stop.sizeHint().width() or stop.height() < stop.sizeHint().height():
            yield f"Stop is {stop.size()} and needs {stop.sizeHint()}"
        if not window.rect().contains(place(stop)):
            yield f"Stop at {place(stop)} is not whole in the window"


def overlaps(window: MainWindow) -> Iterator[str]:
    """Return overlapping widgets in bars and titles, and overlapping docks."""
    bars = [
        bar for kind in (AppBar, RunBar, ToolBar, StatusBar, DockTitle) for bar in window.findChildren(kind)
    ]
    for bar in bars:
        if (
            bar.isVisible() and not bar.visibleRegion().isEmpty()
        ):  # not in docks behind a tab, which Qt moves off-screen
            yield from _pairs([child for child in bar.children() if isinstance(child, QWidget)])
    if window.bench is not None:
        docks = window.bench.docks.values()
        yield from _pairs([dock for dock in docks if dock.is_front and not dock.isFloating()])


def _pairs(widgets: list[QWidget]) -> Iterator[str]:
    seen = [each for each in widgets if each.isVisible() and not each.size().isEmpty()]
    for one, other in combinations(seen, 2):
        if place(one).intersects(place(other)):
            names = [
                f"{type(each).__name__} “{each.accessibleName()}” {place(each)}" for each in (one, other)
            ]
            yield f"{names[0]} lies on {names[1]}"


@pytest.mark.parametrize(("percent", "mode"), [(100, "light"), (150, "dark"), (200, "light")])
def test_no_text_is_clipped_and_no_widgets_overlap_at_any_window_and_text_size(
    qtbot, window: MainWindow, percent: int, mode: Mode
) -> None:
    window.theme.set_mode(mode)
    window.theme.set_text_percent(percent)
    faults: list[str] = []
    for size in SIZES:
        for layout in ("start", "behaviour", "developer"):
            if layout == "start":
                window.show_start()
            else:
                window.show_layout(layout)
            window.resize(*size)
            settle(qtbot, window)
            assert window.size().toTuple() == size
            found = [*stops(window), *overlaps(window), *clipped(window)]
            if layout == "behaviour":
                page = window.benches[layout].docks["behaviour"].width()
                tools = (TILES if page < NARROW * percent / 100 else NAMES) * percent / 100
                if page - tools < MIN_CANVAS:
                    found.append(f"the canvas has {page - tools:.0f} px")
            faults += [f"{size}, {percent} %, {layout}: {fault}" for fault in found]
    assert not faults, "\n".join(["", *faults])


FOLDING = {"robot", "camera", "sensors", "problems", "variables"}


def tabs_of(bench: Workbench, name: str) -> set[str]:
    """Return the panels of `FOLDING` that are tabified with a panel."""
    there = {
        dock.description.name
        for dock in bench.tabifiedDockWidgets(bench.docks[name])
        if isinstance(dock, Dock)
    }
    return there & FOLDING


def test_panels_are_tabified_stepwise_in_small_windows_and_separated_in_large_windows(
    qtbot, window: MainWindow
) -> None:
    window.resize(1440, 900)
    bench = window.show_layout("behaviour")
    docks = bench.docks
    settle(qtbot, window)
    assert tabs_of(bench, "robot") == set() == tabs_of(bench, "sensors")
    for percent, size, of_robot, of_sensors in (
        (100, (1100, 800), {"camera"}, set()),
        (100, (1024, 600), {"camera"}, {"problems", "variables"}),
        (
            200,
            (1024, 600),
            {"camera", "sensors", "problems", "variables"},
            {"camera", "robot", "problems", "variables"},
        ),
        (100, (1024, 600), {"camera"}, {"problems", "variables"}),
        (100, (1440, 900), set(), set()),
    ):
        window.theme.set_text_percent(percent)
        window.resize(*size)
        qtbot.waitUntil(lambda of_robot=of_robot: tabs_of(bench, "robot") == of_robot)
        qtbot.waitUntil(lambda of_sensors=of_sensors: tabs_of(bench, "sensors") == of_sensors)
        settle(qtbot, window)
        assert docks["robot"].is_front
        assert (
            "problems" not in of_robot or bench.docks["robot"].title.tabs[0] == docks["robot"].panel.title()
        )
    columns = [(docks[name].x(), docks[name].y()) for name in ("behaviour", "robot", "camera", "sensors")]
    assert columns[0][0] < columns[1][0] == columns[2][0] == columns[3][0]
    assert columns[1][1] < columns[2][1] < columns[3][1]
    assert docks["problems"].x() == docks["behaviour"].x()


def test_tabified_panels_stay_tabified_after_restart(qtbot, window: MainWindow) -> None:
    window.resize(1024, 600)
    bench = window.show_layout("behaviour")
    settle(qtbot, window)
    again = Workbench(window.theme, BEHAVIOUR, window.panels, window.context)
    qtbot.addWidget(again)
    again.resize(bench.size())
    again.show()
    assert again.restore(bench.save())
    qtbot.waitUntil(lambda: tabs_of(again, "sensors") == {"problems", "variables"})
    again.resize(1440, 800)
    qtbot.waitUntil(lambda: tabs_of(again, "sensors") == set() == tabs_of(again, "robot"))
    again.dispose()


def test_tab_of_a_tabified_panel_shows_a_count_badge(qtbot, window: MainWindow) -> None:
    window.resize(1024, 600)
    bench = window.show_layout("behaviour")
    settle(qtbot, window)
    document = window.session.document

    def badge() -> tuple[str, str] | None:
        window.tick()
        tabs = bench.docks["sensors"].title.findChildren(TitleTab)
        return next(tab.badge for tab in tabs if tab.text() == "Problems" and tab.isVisible())

    document.found = (Problem("error", None, None, "x", "x is not known."),)
    document.apply_edit({"blocks": {"blocks": [{"type": "control_wait", "id": "one"}]}})
    qtbot.waitUntil(lambda: badge() == ("1", "error"))
    document.found = ()
    document.apply_edit({"blocks": {"blocks": [{"type": "control_wait", "id": "two"}]}})
    qtbot.waitUntil(lambda: badge() is None)


def test_tab_in_a_narrow_title_is_shortened_and_has_a_tooltip(qtbot, window: MainWindow) -> None:
    window.theme.set_text_percent(200)
    window.resize(1024, 600)
    bench = window.show_layout("behaviour")
    settle(qtbot, window)
    tabs = {tab.text(): tab for tab in bench.docks["robot"].title.findChildren(TitleTab) if tab.isVisible()}
    assert tabs["Problems"].toolTip() == "Problems"
    assert tabs["Problems"].width() < tabs["Problems"].full_width()
    window.theme.set_text_percent(100)
    settle(qtbot, window)
    tabs = {tab.text(): tab for tab in bench.docks["sensors"].title.findChildren(TitleTab) if tab.isVisible()}
    assert tabs["Problems"].width() >= tabs["Problems"].full_width()
    assert tabs["Problems"].toolTip() == ""


def test_app_bar_shortens_its_texts_before_collapsing_its_menus(
    qtbot, window: MainWindow, tmp_path: Path
) -> None:
    window.resize(1024, 600)
    window.show_layout("behaviour")
    settle(qtbot, window)
    bar = window.bar
    assert bar.menus.width() >= bar.menus.sizeHint().width()
    wide = bar.switch.width()
    window.theme.set_text_percent(200)
    settle(qtbot, window)
    assert bar.menus.width() >= bar.menus.sizeHint().width()
    assert bar.switch.width() < wide
    button = bar.switch.selected_button()
    assert button is not None
    assert button.toolTip() == "Behaviour"
    window.theme.set_text_percent(100)
    settle(qtbot, window)
    assert bar.switch.width() == wide
    assert button.toolTip() == ""


def test_search_field_is_wide_enough_and_the_layout_switch_stays_centred(qtbot, window: MainWindow) -> None:
    window.resize(1024, 600)
    window.show_start()
    settle(qtbot, window)
    assert window.bar.search.width() >= window.bar.search.sizeHint().width()
    window.resize(1440, 900)
    window.show_layout("behaviour")
    settle(qtbot, window)
    bar = window.bar
    assert abs(place(bar.switch).center().x() - place(bar).center().x()) < 3, "in the middle"


def test_question_of_the_start_page_is_placed_higher_in_a_low_window(qtbot, window: MainWindow) -> None:
    window.show_start()
    tops = []
    for height in (600, 900, 600):
        window.resize(1024, height)
        settle(qtbot, window)
        tops.append(place(window.start._question).y())
    assert tops[0] == tops[2] < tops[1]


def test_status_chip_in_a_narrow_title_loses_its_text_before_the_tabs_do(
    qtbot, theme: Theme, window: MainWindow
) -> None:
    chip = Chip(theme, "ready")

    class WithChip(PanelWidget):
        def header_widgets(self) -> list[QWidget]:
            return [chip]

    panel = WithChip(window.show_layout("behaviour").docks["robot"].panel.context, "Pepper")
    title = DockTitle(theme, panel, "comfortable")
    qtbot.addWidget(panel)
    qtbot.addWidget(title)
    title.set_tabs([("Pepper", "bot", True, lambda: None), ("Camera", "camera", False, lambda: None)])
    title.resize(320, 40)
    title.show()
    front, behind = title.findChildren(TitleTab)
    names = front.full_width(), behind.full_width()
    qtbot.waitUntil(lambda: (front.width(), behind.width()) == names)
    assert chip.width() == chip.full_width()

    chip.set("virtual, ready, and moving")  # longer, while the title keeps its size
    qtbot.waitUntil(lambda: chip.width() == chip.icon_only_width())
    assert (front.width(), behind.width()) == names
    assert chip.toolTip() == "virtual, ready, and moving"
    title.resize(195, 40)
    qtbot.waitUntil(lambda: behind.width() == behind.icon_only_width())
    assert front.width() >= front.full_width()
    title.resize(500, 40)
    qtbot.waitUntil(lambda: chip.width() == chip.full_width())


def dock_title(qtbot, window: MainWindow, widgets: list[QWidget], names: tuple[str, ...]) -> DockTitle:
    """Return the title bar of a panel with these header widgets; the last name is that of the front tab."""

    class WithHeader(PanelWidget):
        def header_widgets(self) -> list[QWidget]:
            return widgets

    panel = WithHeader(window.show_layout("behaviour").docks["robot"].panel.context, "Camera")
    title = DockTitle(window.theme, panel, "compact")
    qtbot.addWidget(panel)
    qtbot.addWidget(title)
    title.set_tabs([(name, "bot", name == names[-1], lambda: None) for name in names])
    title.resize(800, 32)
    title.show()
    return title


def test_off_chip_is_reduced_to_its_icon_if_the_tabs_need_its_room(qtbot, window: MainWindow) -> None:
    chip = Chip(window.theme, "No program yet", "off")
    title = dock_title(qtbot, window, [chip], tuple("ABCDEF"))
    qtbot.waitUntil(lambda: chip.width() == chip.full_width())
    title.resize(285, 32)
    qtbot.waitUntil(lambda: chip.width() == chip.icon_only_width())
    assert chip.toolTip() == "No program yet"
    qtbot.waitUntil(lambda: not list(overlaps_in(title)))
    title.resize(800, 32)
    qtbot.waitUntil(lambda: chip.width() == chip.full_width())


def test_filter_in_a_narrow_title_shows_only_its_icon_and_no_button_lies_on_it(
    qtbot, window: MainWindow
) -> None:
    field, repeat = FilterField(window.theme, "Filter sent messages"), IconButton(window.theme, "repeat", "R")
    title = dock_title(qtbot, window, [field, repeat], ("Console", "Alarms", "Nodes", "Sent"))
    for width in (285, 500, 250):
        title.resize(width, 32)
        qtbot.waitUntil(lambda: not list(overlaps_in(title)))
        assert field.isVisible()
    assert field.toolTip() == "Filter sent messages"
    assert field.placeholderText() == ""
    title.resize(800, 32)
    qtbot.waitUntil(lambda: field.placeholderText() == "Filter")
    assert field.toolTip() == ""


def overlaps_in(title: DockTitle) -> Iterator[str]:
    """Return overlapping or cut widgets in the row of a title bar."""
    row = title.more.parentWidget()
    children = [child for child in row.children() if isinstance(child, QWidget) and child.isVisible()]
    yield from _pairs(children)
    for child in children:
        if not row.rect().contains(child.geometry()):
            yield f"{type(child).__name__} at {child.geometry()} is cut"


SCREEN = QRect(0, 0, 1024, 600)
STOP = QRect(780, 50, 230, 52)


@pytest.mark.parametrize(
    ("menu", "goes_to"),
    [
        (QRect(10, 40, 300, 500), (10, 40)),  # covers nothing: not moved
        (QRect(700, 40, 300, 500), (480, 40)),  # left of Stop
        (QRect(60, 60, 900, 300), (60, 102)),  # too wide for the left: below Stop
    ],
)
def test_menu_that_would_cover_stop_is_moved(menu: QRect, goes_to: tuple[int, int]) -> None:
    assert geometry_beside_stop(menu, STOP, SCREEN).topLeft().toTuple() == goes_to
    assert geometry_beside_stop(menu, STOP, SCREEN).size() == menu.size()


def test_menu_that_is_too_wide_to_avoid_stop_is_narrowed() -> None:
    assert geometry_beside_stop(QRect(0, 0, 1000, 590), STOP, SCREEN) == QRect(0, 0, 780, 590)
    early = QRect(100, 50, 230, 52)  # no room for text left of it
    assert geometry_beside_stop(QRect(0, 0, 1000, 590), early, SCREEN) == QRect(0, 0, 1000, 590)


@pytest.mark.parametrize("wide", [24, 34, 90])
def test_count_badge_on_a_narrow_tab_is_not_clipped(qtbot, theme: Theme, wide: int) -> None:
    tab = TitleTab(theme, "Problems", "triangle-alert", False)
    qtbot.addWidget(tab)
    tab.set_icon_only(True)
    tab.show_badge(("2", "error"))
    tab.resize(wide, 30)
    tab.show()
    picture, ring = tab.grab().toImage(), theme.colour(theme.status("error").colour)

    def is_ring(x: int) -> bool:
        seen = picture.pixelColor(x, 15)
        return abs(seen.red() - ring.red()) + abs(seen.blue() - ring.blue()) < 40

    near = [x for x in range(picture.width()) if is_ring(x)]
    assert near[-1] - near[0] >= 15, "both sides of the ring are there"
    assert near[0] >= 1
