"""What was lost in the last 30 s."""

from __future__ import annotations

from app.core.network.losses import WINDOW_S, RecentLosses


def test_only_what_was_lost_lately_counts() -> None:
    losses = RecentLosses()
    assert losses.count(100, 0.0) == 0  # lost before we looked
    assert losses.count(103, 1.0) == 3
    assert losses.count(105, 20.0) == 5
    assert losses.count(105, 1.5 + WINDOW_S) == 2
    assert losses.count(105, 21.0 + WINDOW_S) == 0


def test_a_topic_that_vanished_takes_its_total_along() -> None:
    losses = RecentLosses()
    losses.count(10, 0.0)
    assert losses.count(0, 1.0) == 0
    assert losses.count(2, 2.0) == 2
