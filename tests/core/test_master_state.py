"""A master that has just come may not know everybody yet."""

from __future__ import annotations

from app.core.network.master_state import LEARNING_S, Learning
from nep.protocol.graph_view import GraphView


def view(epoch: int) -> GraphView:
    return GraphView(epoch, 1, {}, {})


def test_the_first_master_and_the_same_one_are_believed_at_once() -> None:
    learning = Learning()
    assert not learning.still(None, view(1), 0.0)
    assert not learning.still(view(1), view(1), 1.0)


def test_another_master_is_believed_when_it_had_time_to_learn() -> None:
    learning = Learning()
    assert learning.still(view(1), view(2), 10.0)
    assert learning.still(view(1), view(2), 10.0 + LEARNING_S - 0.1)
    assert not learning.still(view(1), view(2), 10.0 + LEARNING_S)


def test_a_third_one_begins_to_learn_anew() -> None:
    learning = Learning()
    learning.still(view(1), view(2), 10.0)
    assert learning.still(view(1), view(3), 10.0 + LEARNING_S)
