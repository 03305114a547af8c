"""Tests of the toolbox search with English and Spanish words."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from nep.i18n import install, language
from tests.blocks.samples import nao, robot
from tests.ui.blockly_person import START, WAIT_MS, Person, editor, workspace

pytestmark = pytest.mark.web

FIELD = ".nepTab:not([hidden]) .nepSearch input"
FLYOUT = ".nepTab:not([hidden]) .nepCategory.blocklyFlyout"
FIRST = f"""(all => all.sort((a, b) => a.getBoundingClientRect().top - b.getBoundingClientRect().top)[0])(
    [...document.querySelectorAll('{FLYOUT} .blocklyBlockCanvas > .blocklyDraggable')])"""

ENGLISH = {
    "loop": "control_repeat",
    "repeat": "control_repeat",
    "always": "control_forever",
    "if then": "control_if",
    "otherwise": "control_if_else",
    "sleep": "control_wait",
    "timeout": "control_wait_until_at_most",
    "stop all": "control_stop_program",
    "green flag": "events_started",
    "subscribe": "events_message",
    "send": "events_broadcast",
    "print": "messages_write",
    "question": "asking_ask",
    "quiz": "asking_choices",
    "menu": "asking_choices",
    "dice": "values_random",
    "+": "values_arithmetic",
    "minus": "values_arithmetic",
    "less than": "values_compare",
    "and": "values_logic",
    "opposite": "values_not",
    "concatenate": "values_join",
    "sqrt": "numbers_function",
    "max": "numbers_of_two",
    "average": "lists_total",
    "sort": "lists_copy",
    "append": "lists_add",
    "for each": "lists_each",
    "stopwatch": "sensing_timer",
    "score": "variables_change",
    "variable": "variables_set",
    "my block": "functions_define",
    "talk": "robot_pepper_do_say",
    "speak": "robot_pepper_do_say",
    "spin": "robot_pepper_do_turn",
    "rotate": "robot_pepper_do_turn",
    "move forward": "robot_pepper_do_go_home",
    "led": "robot_pepper_do_light",
    "color": "robot_pepper_do_light",
    "happy": "robot_pepper_do_look",
    "microphone": "robot_pepper_when_heard",
    "sonar": "robot_pepper_get_distance",
    "charge": "robot_pepper_get_battery",
    "bumper": "robot_pepper_when_touched",
    "gesture": "robot_nao_do_wave",
    # in any order
    "left turn": "robot_pepper_do_turn",
    "then if": "control_if",
    # a wrong, a missing and an extra letter, two swapped letters
    "repeet": "control_repeat",
    "brodcast": "events_broadcast",
    "waitt": "control_wait",
    "trun": "robot_pepper_do_turn",
    # one matching word, one word without matches
    "rotate zzyzx": "robot_pepper_do_turn",
}
SPANISH = {
    "bucle": "control_repeat",
    "ciclo": "control_repeat",
    "por siempre": "control_forever",
    "si entonces": "control_if",
    "sino": "control_if_else",
    "pausa": "control_wait",
    "detener todo": "control_stop_program",
    "bandera verde": "events_started",
    "difundir": "events_broadcast",
    "enviar mensaje": "events_broadcast",
    "imprimir": "messages_write",
    "preguntar": "asking_ask",
    "opciones": "asking_choices",
    "menú": "asking_choices",
    "cuestionario": "asking_choices",
    "azar": "values_random",
    "dado": "values_random",
    "restar": "values_arithmetic",
    "mayor que": "values_compare",
    "y": "values_logic",
    "unir": "values_join",
    "raiz cuadrada": "numbers_function",
    "raíz cuadrada": "numbers_function",
    "promedio": "lists_total",
    "cronometro": "sensing_timer",
    "función": "functions_define",
    "mis bloques": "functions_define",
    "hablar": "robot_pepper_do_say",
    "rotar": "robot_pepper_do_turn",
    "caminar": "robot_pepper_do_go_home",
    "luces": "robot_pepper_do_light",
    "bateria": "robot_pepper_get_battery",
    "lejos": "robot_pepper_get_distance",
    "choque": "robot_pepper_when_touched",
    "saludar": "robot_nao_do_wave",
    "repteir": "control_repeat",
    # English words, too
    "loop": "control_repeat",
    "random": "values_random",
}

# Terms of Scratch users: these results come first and second, in any order if both are meant.
LEADING = {
    "sum": ["values_arithmetic", "variables_change"],
    "add": ["values_arithmetic", "variables_change"],
    "plus": ["values_arithmetic"],
    "times": ["control_repeat", "values_arithmetic"],
    "multiply": ["values_arithmetic"],
    "divide": ["values_arithmetic"],
    "mod": ["values_arithmetic"],
    "change": ["variables_change"],
    "set": ["variables_set"],
    "when flag clicked": ["events_started"],
    "wait": ["control_wait", "control_wait_until"],
    "repeat until": ["control_while"],
    "if": ["control_if", "control_if_else"],
    "else": ["control_if_else"],
    "stop": ["control_stop_script"],
    "broadcast": ["events_broadcast"],
    "receive": ["events_received"],
    "ask": ["asking_ask"],
    "answer": ["asking_answer", "asking_ask"],
    "touching": ["robot_pepper_when_touched"],
    "timer": ["sensing_timer", "sensing_reset"],
    "date": ["sensing_now"],
    "pick random": ["values_random"],
    "join": ["values_join"],
    "letter": ["texts_letter"],
    "length": ["values_length"],
    "contains": ["texts_contains"],
    "round": ["values_round"],
    "not": ["values_not"],
    "or": ["values_logic"],
    "equals": ["values_compare"],
    "greater": ["values_compare"],
    "item": ["lists_get"],
    "define": ["functions_define"],
}
LEADING_SPANISH = {
    "suma": ["values_arithmetic", "variables_change"],
    "sumar": ["values_arithmetic", "variables_change"],
    "más": ["values_arithmetic"],
    "restar": ["values_arithmetic"],
    "dividir": ["values_arithmetic"],
    "cambiar": ["variables_change"],
    "poner": ["variables_set"],
    "esperar": ["control_wait", "control_wait_until"],
    "siempre": ["control_forever"],
    "si": ["control_if", "control_if_else"],
    "detener": ["control_stop_script"],
    "recibir": ["events_received"],
    "respuesta": ["asking_answer"],
    "tocar": ["robot_pepper_when_touched"],
    "fecha": ["sensing_now"],
    "aleatorio": ["values_random"],
    "unir": ["values_join"],
    "letra": ["texts_letter"],
    "longitud": ["values_length"],
    "contiene": ["texts_contains"],
    "redondear": ["values_round"],
    "no": ["values_not"],
    "o": ["values_logic"],
    "igual": ["values_compare"],
    "mayor": ["values_compare"],
    "definir": ["functions_define"],
}


@pytest.fixture
def opened(qtbot) -> Iterator[Callable[[str], Person]]:
    """Function that opens the editor in a language, with two robots."""
    before = language()

    def show(wanted: str) -> Person:
        install(wanted)
        view = editor(qtbot, editor_definitions([robot("Pepper"), nao()]), 1320, 700)
        view.load(workspace(START))
        with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
            view.show()
        them = Person(qtbot, view)
        them.box(FIELD)
        return them

    yield show
    install(before)


TYPED = f"""(words => {{
    const field = document.querySelector({FIELD!r});
    field.value = words;
    field.dispatchEvent(new Event('input'));
    field.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Tab'}}));
}})"""
"""JavaScript that types words into the search field; Tab shows the results without delay."""


def first_two(them: Person, words: str) -> list[str]:
    """Return the types of the first two blocks found for these words."""
    of_all = f"[...document.querySelectorAll('{FLYOUT} .blocklyBlockCanvas > .blocklyDraggable')]"
    top = "(e => e.getBoundingClientRect().top)"
    return them.ask(
        f"({TYPED}({json.dumps(words)}), {of_all}"
        f".sort((a, b) => {top}(a) - {top}(b)).slice(0, 2)"
        ".map(e => [...e.classList].find(name => /^[a-z]+_/.test(name))))"
    )


def found(them: Person, words: str) -> str:
    """Return the type of the first block found for these words, or "" if there is none."""
    return them.ask(
        f"({TYPED}({json.dumps(words)}), "
        f"[...({FIRST})?.classList ?? []].find(name => /^[a-z]+_/.test(name)) ?? '')"
    )


@pytest.mark.parametrize(("wanted", "table"), [("en", ENGLISH), ("es", SPANISH)])
def test_search_terms_and_synonyms_find_the_expected_block(opened, wanted, table):
    them = opened(wanted)
    assert {words: found(them, words) for words in table} == table


@pytest.mark.parametrize(("wanted", "table"), [("en", LEADING), ("es", LEADING_SPANISH)])
def test_scratch_search_terms_rank_the_block_among_the_first_two(opened, wanted, table):
    them = opened(wanted)
    first = {words: first_two(them, words) for words in table}
    assert {words: types for words, types in first.items() if not set(table[words]) <= set(types)} == {}


def test_search_shows_matching_blocks_and_enter_inserts_the_first_match(qtbot, opened):
    them = opened("en")
    them.click(FIELD)
    QTest.keyClicks(them.target, "nap pause")
    them.wait_for(f"document.querySelector({FIELD!r}).value", "nap pause")
    them.box(f"{FLYOUT} .control_wait")
    them.press(Qt.Key_Return)
    qtbot.waitUntil(lambda: "control_wait" in json.dumps(them.tops()), timeout=WAIT_MS)


def test_search_without_results_shows_suggestions(opened):
    them = opened("en")
    them.click(FIELD)
    QTest.keyClicks(them.target, "zzyzx")
    them.wait_for(
        f"[...document.querySelectorAll('{FLYOUT} .blocklyFlyoutLabelText')].map(e => e.textContent.trim())",
        [
            "No blocks match “zzyzx”",
            "Try a simpler word, such as “turn” or “say”,",
            "or browse the categories.",
        ],
    )


def shown(them: Person) -> int:
    """Return the number of blocks in the flyout."""
    return them.ask(f"document.querySelectorAll('{FLYOUT} .blocklyBlockCanvas > .blocklyDraggable').length")


def test_search_runs_once_per_query_and_not_per_letter(opened):
    them = opened("en")
    them.ask(
        "(window.made = 0, new MutationObserver(all => window.made +="
        " all.flatMap(each => [...each.addedNodes])"
        ".filter(each => each.matches?.('.robot_pepper_do_turn')).length)"
        f".observe(document.querySelector('{FLYOUT} .blocklyBlockCanvas'), {{childList: true}}))"
    )
    them.ask(
        f"'turn'.split('').forEach((_, at) => {{ const field = document.querySelector('{FIELD}');"
        " field.value = 'turn'.slice(0, at + 1); field.dispatchEvent(new Event('input')); })"
    )
    them.wait_for(f"!!document.querySelector('{FLYOUT} .robot_pepper_do_turn')")
    assert them.ask("window.made") == 1
    assert found(them, "turn") == "robot_pepper_do_turn"


def test_enter_uses_the_typed_query_and_not_older_results(qtbot, opened):
    them = opened("en")
    them.click(FIELD)
    assert found(them, "wait") == "control_wait"
    them.ask(
        "(field => { field.value = 'say'; field.dispatchEvent(new Event('input'));"
        " field.dispatchEvent(new KeyboardEvent('keydown', {key: 'Enter'})); })"
        f"(document.querySelector('{FIELD}'))"
    )
    qtbot.waitUntil(lambda: "robot_pepper_do_say" in json.dumps(them.tops()), timeout=WAIT_MS)


def test_more_results_button_shows_the_remaining_blocks(opened):
    them = opened("en")
    found(them, "e")
    few = shown(them)
    assert 8 <= few < 20
    button = f"document.querySelector('{FLYOUT} .blocklyFlyoutButton')"
    words = them.ask(f"{button}.textContent").replace("\u00a0", " ")
    assert words == f"Show {40 - few} more"
    for kind in ("pointerdown", "pointerup"):
        them.ask(f"{button}.dispatchEvent(new PointerEvent('{kind}', {{bubbles: true}}))")
    them.until(lambda: shown(them) == 40, "all are shown")
    them.wait_for(button, None)


@pytest.mark.parametrize("wanted", ["search", "find"])
def test_keys_typed_right_after_opening_the_search_are_all_entered(opened, wanted):
    them = opened("en")
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.view.show_tab("new", workspace(*({**START, "id": f"many{at}"} for at in range(60))))
    (them.view.open_search if wanted == "search" else them.view.open_find)()
    QTest.keyClicks(them.target, "wait")
    field = FIELD if wanted == "search" else ".nepFind input"
    them.wait_for(f"document.querySelector('{field}').value", "wait")
    QTest.keyClicks(them.target, " a")
    them.wait_for(f"document.querySelector('{field}').value", "wait a")


def loading_editor(qtbot) -> BlocklyView:
    """Return an editor whose page takes keys but isn't loaded; on a busy computer both may come together."""
    for _ in range(20):
        view = editor(qtbot, editor_definitions([robot("Pepper")]), 1320, 700)
        view.show()
        qtbot.waitUntil(
            lambda view=view: view.web is not None and view.web.keyboard_target() is not None, timeout=WAIT_MS
        )
        if not view.is_ready:
            return view
        view.hide()
    raise AssertionError("the page was loaded each time before it could take keys")


def test_keys_typed_before_the_page_is_loaded_reach_the_search_field(qtbot):
    view = loading_editor(qtbot)
    view.open_search()
    QTest.keyClicks(view.web.keyboard_target(), "wait")
    assert not view.is_ready
    qtbot.waitUntil(lambda: view.is_ready, timeout=WAIT_MS)
    them = Person(qtbot, view)
    them.wait_for(f"document.querySelector('{FIELD}')?.value", "wait")


MORE = [robot("Pepper"), nao(), robot("Sonny")]
"""Robots after another Pepper has connected."""
SAYS = f"document.querySelectorAll('{FLYOUT} .blocklyBlockCanvas > .robot_pepper_do_say').length"
"""JavaScript for the number of Pepper's say blocks in the flyout."""


def test_search_text_and_focus_are_kept_when_a_robot_connects(opened):
    them = opened("en")
    them.click(FIELD)
    QTest.keyClicks(them.target, "sa")
    them.box(f"{FLYOUT} .robot_pepper_do_say")
    them.view.set_definitions(editor_definitions(MORE))
    them.wait_for(SAYS, 2)
    QTest.keyClicks(them.target, "y")
    them.wait_for(f"document.querySelector({FIELD!r}).value", "say")
    them.wait_for(f"document.activeElement === document.querySelector({FIELD!r})")


def test_text_selection_in_the_search_field_is_kept_when_a_robot_connects(opened):
    them = opened("en")
    them.click(FIELD)
    QTest.keyClicks(them.target, "wait")
    them.wait_for(f"document.querySelector({FIELD!r}).value", "wait")
    them.ask(f"document.querySelector({FIELD!r}).setSelectionRange(1, 3)")
    them.view.set_definitions(editor_definitions(MORE))
    them.wait_for("document.body.textContent.includes('Sonny')")
    them.ask(f"document.querySelector({FIELD!r}).focus()")
    assert them.ask(
        f"(f => [f.value, f.selectionStart, f.selectionEnd])(document.querySelector({FIELD!r}))"
    ) == ["wait", 1, 3]


FOCUSED = "(it => [it.getAttribute('aria-label') ?? '', it.textContent])(document.activeElement)"


def test_keyboard_focus_stays_on_a_category_when_a_robot_connects(opened):
    them = opened("en")
    them.open_category("Control")
    them.wait_for(f"{FOCUSED}[1].includes('Control')")
    before = them.ask(FOCUSED)
    them.view.set_definitions(editor_definitions(MORE))
    them.wait_for("document.body.textContent.includes('Sonny')")
    them.wait_for(FOCUSED, before)


def test_keyboard_focus_stays_on_a_flyout_block_when_a_robot_connects(opened):
    them = opened("en")
    them.click(FIELD)
    QTest.keyClicks(them.target, "say")
    them.box(f"{FLYOUT} .robot_pepper_do_say")
    them.press(Qt.Key_Down)
    holder = "document.activeElement.closest('.blocklyDraggable')?.classList.contains('robot_pepper_do_say')"
    them.wait_for(holder)
    them.view.set_definitions(editor_definitions(MORE))
    them.wait_for(SAYS, 2)
    them.wait_for(holder)
