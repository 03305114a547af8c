"""Tests of the appearance of the block editor: theme, running blocks, errors and toolbox."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor

from app.ui.blockly.messages import HistoryChanged, SensorsShown
from tests.ui.blockly_person import DEFINITIONS, PICTURE, START, TOKENS, WAIT_MS, outlined, received

pytestmark = pytest.mark.web


def test_theme_change_keeps_blocks_and_undo_stack(qtbot, view, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [], timeout=WAIT_MS)
    view.set_theme(TOKENS, is_dark=True)
    dark = TOKENS["colour"]["dark"]["workspace"]
    them.wait_for(
        "getComputedStyle(document.querySelector('.blocklyMainBackground').closest('svg')).backgroundColor",
        "rgb({}, {}, {})".format(*QColor(dark).getRgb()[:3]),
    )
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [START], timeout=WAIT_MS)
    primary = TOKENS["block"]["events"]["dark"]["tertiary"].lower()
    them.wait_for("document.querySelector('[data-id=start] > .blocklyPath').getAttribute('stroke')", primary)


def test_flat_theme_tokens_are_supported(view, person):
    them = person(START)
    light = TOKENS["colour"]["light"]
    flat = {
        "colour": {name: value for name, value in light.items() if isinstance(value, str)}
        | {"grid": "#123456"},
        "block": {name: {**each["light"], "icon": each["icon"]} for name, each in TOKENS["block"].items()},
        "reducedMotion": True,
    }
    view.set_theme(flat, is_dark=False)
    them.wait_for("getComputedStyle(document.documentElement).getPropertyValue('--nep-grid')", "#123456")
    them.wait_for("document.documentElement.classList.contains('reduced')")


def test_running_and_stopped_blocks_are_outlined(view, person):
    view.set_reduced_motion(False)
    them = person(state=PICTURE)
    view.highlight(["say_touch", "battery"])
    them.wait_for(outlined("running") + ".sort()", ["battery", "say_touch"])
    shape = "document.querySelector('[data-id=say_touch] > {}').getAttribute('d')"
    assert them.ask(shape.format(".nepState .nepOutline")) == them.ask(shape.format(".blocklyPath"))
    animated = "getComputedStyle(document.querySelector('.nepGlow')).animationName"
    them.wait_for("!!document.querySelector('.nepGlow')")  # a block that ends immediately gets no glow
    them.wait_for(animated, "nepBreathe")
    view.set_reduced_motion(True)
    them.wait_for(animated, "none")
    view.highlight([])
    view.mark_stopped(["say_touch"])
    them.wait_for(outlined("running"), [])
    them.wait_for(outlined("stopped"), ["say_touch"])


def test_layout_stays_fast_after_300_highlights(qtbot, view, person):
    them = person(state=PICTURE)
    ids = ["say_touch", "battery", "wave"]
    for number in range(300):
        view.highlight([ids[number % 3]])
    them.wait_for(outlined("running"), ["wave"])
    # The fastest of five layouts: another program may interrupt each of them.
    script = (
        "Math.min(...[1, 2, 3, 4, 5].map(width => { document.body.style.paddingRight = `${width}px`;"
        "const begin = performance.now();"
        "document.body.getBoundingClientRect(); return performance.now() - begin; }))"
    )
    assert them.ask(script) < 100


def test_error_is_shown_in_a_bubble_next_to_its_block(view, person):
    them = person(state=PICTURE)
    view.set_errors({"say_touch": "Pepper isn't responding."})
    them.wait_for("document.querySelector('.nepBubble')?.textContent", "Pepper isn't responding.")
    assert them.ask(outlined("error")) == ["say_touch"]
    block = them.box("[data-id=say_touch] > .blocklyPath")
    bubble = them.box(".nepBubble")
    assert 0 < bubble["left"] - block["right"] < 30
    assert block["top"] - 5 < bubble["top"] < block["bottom"]
    view.set_errors({})
    them.wait_for("document.querySelectorAll('.nepBubble, .nepState').length", 0)


def test_warning_is_shown_in_a_bubble_without_an_outline(view, person):
    them = person(state=PICTURE)
    view.set_warnings({"say_touch": "“say” was replaced by “turn”"})
    them.wait_for("document.querySelector('.nepBubble-warning')?.textContent", "“say” was replaced by “turn”")
    assert them.ask(outlined("error")) == []
    block = them.box("[data-id=say_touch] > .blocklyPath")
    bubble = them.box(".nepBubble")
    assert 0 < bubble["left"] - block["right"] < 30
    view.highlight(["wave"])
    them.wait_for(outlined("running"), ["wave"])
    view.set_errors({"say_touch": "Pepper isn't responding."})
    them.wait_for("document.querySelector('.nepBubble')?.textContent", "Pepper isn't responding.")
    view.set_errors({})
    them.wait_for("document.querySelector('.nepBubble')?.textContent", "“say” was replaced by “turn”")
    view.set_warnings({})
    them.wait_for("document.querySelectorAll('.nepBubble').length", 0)


def test_error_outline_appears_together_with_its_message(view, person):
    them = person(state=PICTURE)
    them.ask(
        "(() => { window.seen = []; new MutationObserver(() => document.querySelector('.nepState-error') "
        "&& seen.push(document.body.textContent.includes(`Pepper isn't "
        "responding.`))).observe(document.body, {subtree: true, childList: true}); })()"
    )
    view.set_errors({"say_touch": "Pepper isn't responding."})
    them.wait_for("seen.length > 0")
    assert them.ask("seen[0]") is True


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_find_bar_fits_next_to_the_toolbox_with_large_text(view, person, percent):
    view.set_theme({**TOKENS, "textPercent": percent}, False)
    them = person(state=PICTURE)
    view.open_find()
    them.box(".nepFind")
    on_top = (
        "[...document.querySelectorAll('.nepFind :is(input, button)')]"
        ".map(e => [e, e.getBoundingClientRect()])"
        ".filter(([e, r]) => [[r.left + 2, r.top + 9], [r.right - 2, r.bottom - 9]].some(([x, y]) =>"
        " !e.contains(document.elementFromPoint(x, y)))).length"
    )
    them.wait_for("document.querySelectorAll('.nepFind button').length", 3)
    them.wait_for(on_top, 0)
    beside = (
        "document.querySelector('.nepFind').getBoundingClientRect().left -"
        " document.querySelector('.nepTab:not([hidden]) .blocklyToolbox').getBoundingClientRect().right"
    )
    them.wait_for(f"{beside} >= 0")


def test_blocks_of_absent_robots_are_grey(view, person):
    them = person(state=PICTURE)
    view.set_absent(["wave"])
    grey = "[...document.querySelectorAll('.nepAbsent')].map(e => e.dataset.id)"
    them.wait_for(grey, ["wave"])
    assert them.newest() == PICTURE
    view.set_absent([])
    them.wait_for(grey, [])


def test_live_values_are_shown_without_an_edit(qtbot, view, person):
    them = person(state=PICTURE)
    shown = "document.querySelector('[data-id=battery] .nepLive').textContent.replaceAll('\\u00a0', ' ')"
    histories = received(view, HistoryChanged)
    with qtbot.assertNotEmitted(view.changed, wait=300):
        view.set_live_values({"Pepper/battery": "84 %"})
        them.wait_for(shown, "84 %")
        view.set_live_values({"battery": "83 %"})
        them.wait_for(shown, "83 %")
    assert them.newest() == PICTURE
    assert histories == []


def test_empty_canvas_shows_only_the_grid_and_zoom_buttons(person):
    them = person()
    assert them.ask("document.querySelectorAll('.blocklyBlockCanvas .blocklyBlock').length") == 0
    assert them.ask("document.querySelectorAll('.blocklyTrash, .blocklyZoom').length") == 0
    assert them.ask("document.querySelectorAll('.nepZoom button').length") == 6
    assert them.view.web.request_blocker.blocked_urls == []


def test_zoom_in_zoom_out_and_zoom_to_fit_change_the_scale(qtbot, view, person):
    them = person(state=PICTURE)
    canvas = "document.querySelector('svg.blocklySvg .blocklyBlockCanvas')"
    scale = f"Math.round(new DOMMatrix(getComputedStyle({canvas}).transform).a * 1000) / 1000"
    them.wait_for(scale, 0.8)
    view.zoom_in()
    them.wait_for(f"{scale} > 0.9")
    view.zoom_out()
    view.zoom_out()
    them.wait_for(f"{scale} < 0.75")
    view.zoom_to_fit()
    them.wait_for(f"{scale} > 0.75 && {scale} <= 1")
    view.show_block("battery")
    them.wait_for("!!document.querySelector('[data-id=battery].blocklySelected')")


def test_toolbox_has_the_expected_labels_width_row_height_and_tile_colour(person):
    them = person()
    labels = them.ask(
        "[...document.querySelectorAll('.nepHeading, .blocklyToolboxCategoryLabel')].map(e => e.textContent)"
    )
    assert labels == [
        "Blocks", "Events", "Control", "Values", "Variables", "Functions", "Messages",
        "Peppervirtual", "Speech", "Movement", "Face and lights", "Sensors", "NAOnot connected",
    ]  # fmt: skip
    box = them.box(".blocklyToolbox")
    assert box["right"] - box["left"] == 196
    row = them.box(".blocklyToolboxCategory")
    assert row["bottom"] - row["top"] == 36
    tile = "getComputedStyle(document.querySelector('.nepTile')).backgroundColor"
    events = QColor(TOKENS["block"]["events"]["light"]["primary"]).getRgb()[:3]
    assert them.ask(tile) == "rgb({}, {}, {})".format(*events)


def test_toolbox_reports_that_no_robot_is_connected(view, person):
    them = person()
    contents = DEFINITIONS["toolbox"]["contents"][:7]
    view.set_definitions({**DEFINITIONS, "toolbox": {"kind": "categoryToolbox", "contents": contents}})
    headings = (
        "[...document.querySelectorAll('.nepHeading')].map(e => [...e.children].map(c => c.textContent))"
    )
    them.wait_for(headings, [["Blocks", ""], ["", "No robot", "connected"]])


def test_window_is_notified_of_sensors_shown_in_the_open_toolbox(view, person):
    them = person(START)
    told = received(view, SensorsShown, "sensors")
    them.open_category("Sensors")
    them.until(lambda: told, "the sensors are told")
    assert ("Pepper", "battery") in told[-1]
    count = len(told)
    them.open_category("Events")
    them.until(lambda: told[-1] == (), "none are shown")
    them.open_category("Sensors")
    them.until(lambda: told[-1], "they are shown again")
    view.show_tab("other", {"blocks": {"languageVersion": 0, "blocks": []}})
    them.until(lambda: told[-1] == (), "the other behaviour shows none")
    assert len(told) == count + 3


def test_live_values_are_shown_in_the_flyout(view, person):
    them = person()
    view.set_live_values({"Pepper/battery": "84 %"})
    them.open_category("Sensors")
    live = "document.querySelector('.blocklyFlyout .nepLive')?.textContent.replaceAll('\\u00a0', ' ')"
    them.wait_for(live, "84 %")


def test_stale_live_values_are_faint_and_changing_digits_do_not_change_the_block_width(view, person):
    them = person(state=PICTURE)
    view.set_live_values({"Pepper/battery": "84 %"})
    live = "document.querySelector('.blocklyBlockCanvas .nepLive')"
    them.wait_for(f"{live}.textContent.replaceAll('\\u00a0', ' ')", "84 %")
    path = f"{live}.closest('.blocklyBlock').querySelector('.blocklyPath').getAttribute('d')"
    them.render()  # the width of a block follows its text
    before = them.ask(path)
    view.set_live_values({"Pepper/battery": "79 %"}, ["Pepper/battery"])
    them.wait_for(f"{live}.textContent.replaceAll('\\u00a0', ' ')", "79 %")
    them.wait_for(f"{live}.classList.contains('nepOld')")
    them.render()
    assert them.ask(path) == before
    view.set_live_values({"Pepper/battery": "100 %"})
    them.wait_for(f"{path} != {before!r} && !{live}.classList.contains('nepOld')")
