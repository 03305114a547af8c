from __future__ import annotations

import json

import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from app.ui.inspector_parts import image_summary, plain_words
from app.ui.panels.inspector import LARGE, NOTHING, PANEL, RAW, TREE, InspectorPanel
from nep.message import Message
from tests.ui.fakes import Session, blackboard
from tests.ui.panel_case import Window, button, press, ticks


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> InspectorPanel:
    made = window.make(PANEL, (330, 700))
    qtbot.addWidget(made)
    for widget in made.header:
        qtbot.addWidget(widget)
    assert isinstance(made, InspectorPanel)
    return made


def choose(panel: InspectorPanel, *path: str | int) -> None:
    panel.tree.setCurrentIndex(panel.model.reveal(path))


def test_with_nothing_chosen_it_says_so_and_leads_to_the_topics(panel, window) -> None:
    assert panel.pages.currentIndex() == NOTHING
    assert window.session.watched == []
    press(button(panel.empty, "Choose a topic"))
    assert window.commands == ["panel.topics"]


def test_it_subscribes_exactly_what_it_shows(panel, window) -> None:
    panel.show_topic("/blackboard")
    panel.show_topic("/odom")
    assert window.session.watched == ["/odom"]
    assert (panel.title(), panel.subtitle()) == ("Inspector", "/odom")
    panel.shut()
    assert window.session.watched == []


def test_the_newest_message_as_a_tree_with_its_facts(panel, window) -> None:
    panel.show_topic("/blackboard")
    assert panel.pages.currentIndex() == NOTHING
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    assert panel.pages.currentIndex() == TREE
    choose(panel, "robots", "Pepper", "pose", "y")
    assert panel.foot.path.text() == "robots.Pepper.pose.y"
    assert panel.foot.facts.text().startswith("seq 18\u2009204   ")
    assert "latency" in panel.foot.facts.text()
    assert panel.live.text == "live"


def test_the_next_message_keeps_what_is_expanded_and_marks_what_changed(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard(0))
    panel.refresh()
    joints = panel.model.reveal(("robots", "Pepper", "joints"))
    panel.tree.expand(joints)
    window.session.send("/blackboard", blackboard(1))
    panel.refresh()
    assert panel.tree.isExpanded(panel.model.reveal(("robots", "Pepper", "joints")))
    assert panel.model.node(panel.model.reveal(("stamp",))).changed_s is not None
    assert panel.model.node(panel.model.reveal(("note",))).changed_s is None


def test_what_cannot_be_decoded_is_shown_as_bytes_with_a_sentence(panel, window) -> None:
    panel.show_topic("/faces")
    window.session.send("/faces", b"not json \x00\xff")
    panel.refresh()
    assert panel.pages.currentIndex() == RAW
    assert panel.mode.value == "raw"
    assert panel.sentence.isVisible()
    assert panel.sentence.text().startswith("This can't be read as json: ")
    assert "6e 6f 74" in panel.bytes.text()
    window.session.send("/faces", {"good": 1})
    panel.refresh()
    assert panel.pages.currentIndex() == TREE
    assert not panel.sentence.isVisible()


def test_raw_shows_the_bytes_of_a_good_message_too(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"a": 1})
    panel.refresh()
    press(button(panel.mode, "Raw"))
    assert panel.pages.currentIndex() == RAW
    assert "7b" in panel.bytes.text()
    assert not panel.sentence.isVisible()
    window.session.send("/blackboard", {"b": 1})
    panel.refresh()
    assert "62" in panel.bytes.text()
    press(button(panel.mode, "Tree"))
    assert panel.model.node(panel.model.index(0, 0)).key == "b"


def test_freezing_holds_the_message_until_it_is_pressed_again(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"n": 1})
    panel.refresh()
    panel.freeze.setChecked(True)
    window.session.send("/blackboard", {"n": 2})
    ticks(window, panel)
    assert panel.model.value() == {"n": 1}
    assert panel.live.text == "frozen"
    panel.freeze.setChecked(False)
    assert panel.model.value() == {"n": 2}


def test_copying_a_value_and_a_path(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    choose(panel, "people", 0, "name")
    press(panel.foot.copy_value)
    assert QGuiApplication.clipboard().text() == "Aiko"
    press(panel.foot.copy_path)
    assert QGuiApplication.clipboard().text() == "people[0].name"
    assert window.toasts == ["Copied people[0].name", "Copied the path people[0].name"]
    choose(panel, "robots", "Pepper", "pose")
    panel.copy_value()
    assert json.loads(QGuiApplication.clipboard().text())["y"] == pytest.approx(-0.297)


def test_large_messages_are_read_only_when_asked_for(panel, window) -> None:
    panel.show_topic("/blackboard")
    message = window.session.send("/blackboard", {"data": "x" * 1_200_000})
    panel.refresh()
    assert panel.pages.currentIndex() == LARGE
    assert panel.large._title.text() == "A message of 1.2 MB"
    press(button(panel.large, "Read the newest one"))
    assert panel.pages.currentIndex() == TREE
    assert panel.frozen  # the next large one would hide it again
    window.session.send("/blackboard", {"data": "y" * 1_200_000})
    ticks(window, panel)
    assert panel.model.value() == message.payload


def test_pictures_are_summed_up_not_listed() -> None:
    message = Message(
        "/c", b"\xff\xd8jpeg", "image", "image", extension={"shape": [240, 320, 3], "encoding": "jpeg"}
    )
    assert image_summary(message) == {
        "encoding": "jpeg", "width": 320, "height": 240, "channels": 3, "size": "6 B",
    }  # fmt: skip


def test_pictures_are_not_decoded_to_be_summed_up(panel, window) -> None:
    panel.show_topic("/robot/camera")
    topic = window.session.topics["/robot/camera"]
    told = {"shape": [480, 640, 3], "encoding": "jpeg"}
    topic.newest = Message("/robot/camera", b"no picture at all", "image", "image", seq=1, extension=told)
    panel.refresh()
    assert panel.pages.currentIndex() == TREE
    assert panel.model.value()["width"] == 640
    topic.newest = Message("/robot/camera", b"no picture at all", "image", "image", seq=2)
    panel.refresh()
    assert panel.pages.currentIndex() == RAW  # nothing tells its shape, and its bytes are none


def test_strings_are_shown_as_one_value(panel, window) -> None:
    panel.show_topic("/speech/words")
    window.session.send("/speech/words", b"hello")
    panel.refresh()
    assert panel.model.value() == {"value": "hello"}
    assert not window.session.topics["/speech/words"].new


def test_finding_goes_through_keys_and_values(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    QTest.keyClicks(panel.finder, "aiko")
    assert panel.foot.path.text() == "people[0].name"
    panel.finder.clear()
    QTest.keyClicks(panel.finder, "theta")
    assert panel.foot.path.text() == "robots.Pepper.pose.theta"
    panel.finder.setText("kind")
    first = panel.foot.path.text()
    panel.next_match()
    assert (first, panel.foot.path.text()) == ("objects[0].kind", "objects[1].kind")
    panel.finder.setText("nowhere")
    assert panel.finder.property("wrong") == "true"


def test_a_topic_that_has_gone_says_since_when_and_keeps_its_last_message(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"n": 1})
    panel.refresh()
    window.session.topics["/blackboard"].gone_s = 3.2
    panel.refresh()
    assert panel.live.text == "gone 3 s"
    window.session.topics.remove("/blackboard")
    panel.refresh()
    assert panel.live.text == "gone"
    assert panel.model.value() == {"n": 1}


def test_the_topic_comes_back_with_the_layout(qtbot, panel, window) -> None:
    panel.show_topic("/odom")
    again = window.make(PANEL)
    qtbot.addWidget(again)
    again.restore_state(panel.save_state())
    assert again.subtitle() == "/odom"


@pytest.mark.parametrize(
    ("value", "words"), [("a", "a"), (1.5, "1.5"), (None, "null"), (b"\x01\x02", "01 02"), ([1], "[\n  1\n]")]
)
def test_what_goes_onto_the_clipboard(value: object, words: str) -> None:
    assert plain_words(value) == words
