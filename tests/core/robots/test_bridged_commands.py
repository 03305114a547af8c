"""Tests that a robot commanded through a bridge is recorded as moved, so that Stop includes it."""

from __future__ import annotations

from app.core.robots.motion.bridged_commands import BridgedCommands
from app.robots.description.description import parse, thing_description
from nep.protocol.graph_view import BRIDGES_TOPIC, GraphView, PublisherInfo, TopicInfo
from tests.core.robots.stop_model.robots import ROVER

ROBOT = parse(thing_description(ROVER.thing_model, "Arm"))


def view(**counts: int) -> GraphView:
    """Return a graph in which nodes with these names have published that many commands.

    The node `bridge` announces itself as a bridge.
    """

    def publishers(names: list[str]) -> tuple[PublisherInfo, ...]:
        return tuple(
            PublisherInfo(place, name, (), False, counts.get(name, 0), 0, 0, None, None, None)
            for place, name in enumerate(names)
        )

    topics = {
        BRIDGES_TOPIC: TopicInfo(BRIDGES_TOPIC, "json", "json", publishers(["bridge"])),
        "/Arm/command": TopicInfo("/Arm/command", "robot/command", "json", publishers(list(counts))),
    }
    return GraphView(1, 1, {}, topics)


def test_robot_commanded_by_a_bridge_is_reported_once_per_graph_with_new_commands() -> None:
    reported: list[tuple[tuple[str, ...], str]] = []
    commands = BridgedCommands(lambda names, by: reported.append((tuple(names), by)))
    for graph in (view(bridge=0), view(bridge=1), view(bridge=1), view(bridge=4)):
        commands.update(graph, [ROBOT])
    assert reported == [(("Arm",), "bridge")] * 2


def test_commands_of_programs_other_than_bridges_are_not_reported() -> None:
    reported: list[str] = []
    commands = BridgedCommands(lambda _names, by: reported.append(by))
    commands.update(view(bridge=0, script=5), [ROBOT])
    assert reported == []
