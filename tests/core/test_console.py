"""The console keeps the newest records."""

from __future__ import annotations

from app.core.console import TEXT_LIMIT, Console


def test_it_keeps_the_newest_records_in_order() -> None:
    console = Console(lambda: 5.0, capacity=3)
    for number in range(5):
        console.add("info", "test", str(number))
    assert [record.text for record in console.records] == ["2", "3", "4"]
    assert console.revision == 5
    assert console.records[0].stamp_s == 5.0


def test_a_very_long_text_is_cut_and_says_how_long_it_was() -> None:
    console = Console()
    console.add("info", "test", "x" * (TEXT_LIMIT + 10))
    assert console.records[0].text.endswith(f"… ({TEXT_LIMIT + 10} characters)")


def test_clear_forgets_all() -> None:
    console = Console()
    console.add("warn", "test", "a")
    console.clear()
    assert not console.records
