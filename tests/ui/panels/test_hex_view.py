from __future__ import annotations

from app.ui.panels.watch.inspector.hex_view import HexView, hex_line
from app.ui.theme.theme import Theme


def test_line_shows_offset_bytes_and_printable_characters() -> None:
    assert hex_line(memoryview(b'{"a"\x00\xff'), 0, 16) == ("0000", "7b 22 61 22 00 ff", '{"a"··')
    assert hex_line(memoryview(bytes(range(64))), 32, 4) == ("0020", "20 21 22 23", ' !"#')


def test_new_bytes_are_painted_at_the_kept_scroll_position(qtbot, qapp) -> None:
    view = HexView(Theme("light"))
    qtbot.addWidget(view)
    view.resize(600, 200)
    view.show()
    view.show_bytes(bytes(1_000_000))
    assert view.bytes_per_line() == 16
    assert view.verticalScrollBar().maximum() == 62_500 - view.verticalScrollBar().pageStep()
    view.verticalScrollBar().setValue(30_000)
    before = view.viewport().grab().toImage()
    view.show_bytes(b"\xff" * 1_000_000)
    assert view.verticalScrollBar().value() == 30_000
    assert view.viewport().grab().toImage() != before


def test_narrow_view_has_eight_bytes_per_line(qtbot, qapp) -> None:
    view = HexView(Theme("light"))
    qtbot.addWidget(view)
    view.resize(330, 200)
    view.show()
    view.show_bytes(bytes(20))
    assert view.bytes_per_line() == 8
    assert view.text().splitlines()[2].startswith("0010")
