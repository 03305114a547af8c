"""Tests of run warnings: shown at their block; logged once, at powers of ten and at the end."""

from __future__ import annotations

from app.core.run.run_warnings import RunWarnings

SAID = "“walk” was replaced by “turn”"


def test_warning_stays_at_its_block_with_count_until_next_run() -> None:
    log: list[str] = []
    warnings = RunWarnings(log.append)
    warnings.reset()
    assert warnings.by_block == {}
    warnings.add("a", SAID, 1)
    assert warnings.by_block == {"a": SAID}
    warnings.add("a", SAID, 12)
    warnings.add("b", SAID, 1)
    assert warnings.by_block == {"a": f"{SAID} (12 times)", "b": SAID}
    assert not warnings.clear_if_edited(0)
    assert warnings.clear_if_edited(1)
    assert warnings.by_block == {}
    warnings.add("a", SAID, 13)
    assert warnings.by_block == {"a": f"{SAID} (13 times)"}
    warnings.reset()
    assert warnings.by_block == {}


def test_repeated_warning_does_not_flood_the_console() -> None:
    log: list[str] = []
    warnings = RunWarnings(log.append)
    for _run in range(2):
        warnings.reset()
        for count in range(1, 124):
            warnings.add("a", SAID, count)
        warnings.log_final_counts()
        warnings.log_final_counts()
        assert log == [SAID, f"{SAID} (10 times)", f"{SAID} (100 times)", f"{SAID} (123 times)"]
        log.clear()
    warnings.reset()
    warnings.add("a", SAID, 1)
    warnings.log_final_counts()
    assert log == [SAID]
