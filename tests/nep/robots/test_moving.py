"""Tests of the detection of topics that move a robot, from descriptions, types and subscribers."""

from __future__ import annotations

import pytest

from nep.programs.robots import MovingTopics, RobotControls, moving_topics, parse_controls
from nep.programs.robots.moving import original_robots
from nep.protocol.graph_view import (
    GraphView,
    NodeInfo,
    PatternInfo,
    PublisherInfo,
    SubscriberInfo,
    TopicInfo,
)

ROVER = RobotControls("Rover", frozenset({"/Rover/drive", "/Rover/world"}))


def topic(name: str, msg_type: str = "json", *, publisher: str = "", subscriber: str = "") -> TopicInfo:
    publishers = (PublisherInfo(1, publisher, (), False, 0, 0, 0, None, None, None),) if publisher else ()
    subscribers = (SubscriberInfo(2, subscriber, 0, 0),) if subscriber else ()
    return TopicInfo(name, msg_type, "json", publishers, subscribers)


def graph(*topics: TopicInfo, nodes: tuple[NodeInfo, ...] = (), patterns: tuple[PatternInfo, ...] = ()):
    return GraphView(
        1, 1, {each.id: each for each in nodes}, {each.name: each for each in topics},
        patterns={each.name: each for each in patterns},
    )  # fmt: skip


def test_robot_is_moved_by_the_topics_of_its_description() -> None:
    moving = MovingTopics([ROVER])
    assert moving.robots_moved_by("/Rover/drive") == moving.robots_moved_by("/Rover/world") == ("Rover",)
    assert moving.robots_moved_by("/Rover/command") == ()  # the name alone doesn't count
    assert moving.robots_moved_by("/elsewhere", "robot/command") == ("/elsewhere",)


def test_rize_command_topic_moves_each_robot() -> None:
    fido = RobotControls("Fido", frozenset({"/Fido/command"}))
    assert MovingTopics([ROVER, fido]).robots_moved_by("robot_action") == ("Rover", "Fido")
    assert MovingTopics().robots_moved_by("robot_action") == ("robot_action",)


def test_wildcard_in_a_description_protects_only_topics_that_match() -> None:
    moving = MovingTopics([RobotControls("Rover", frozenset({"/Rover/*/go"}))])
    assert moving.robots_moved_by("/Rover/left/go") == ("Rover",)
    assert moving.robots_moved_by("/Rover/go") == ()


@pytest.mark.parametrize(
    ("description", "topics"),
    [
        ({"title": "R", "rb:topics": {"command": "/c", "world": "/w", "answer": "/a"}}, {"/c", "/w"}),
        ({"title": "R", "actions": {"go": {"forms": [{"href": "nep:/go"}, {"href": "http://x"}]}}}, {"/go"}),
        ({"title": 7, "rb:topics": {"command": "/c", "world": 7}, "actions": [1]}, {"/c"}),
    ],
)
def test_valid_topics_that_move_the_robot_are_read_from_its_description(
    description: object, topics: set[str]
) -> None:
    found = parse_controls(description, "R")
    assert found == RobotControls("R", frozenset(topics))


@pytest.mark.parametrize("description", [None, 3, [], {}, {"title": "R"}, {"rb:topics": {"command": ""}}])
def test_description_without_a_topic_describes_no_robot(description: object) -> None:
    assert parse_controls(description, "R") is None


def test_program_with_unread_description_is_protected_on_all_its_subscriptions() -> None:
    view = graph(
        topic("/Rover/description", "robot/description", publisher="n"), topic("/go", subscriber="n"),
        topic("/other", subscriber="m"),
        patterns=(PatternInfo("/Rover/parts/*", "json", (SubscriberInfo(3, "n", 0, 0),)),),
    )  # fmt: skip
    moving = moving_topics(view, (), ["/Rover/description"])
    assert moving.robots_moved_by("/go") == moving.robots_moved_by("/Rover/command") == ("Rover",)
    assert moving.robots_moved_by("/Rover/parts/arm") == ("Rover",)
    assert moving.robots_moved_by("/other") == ()


def test_driver_without_a_published_description_is_protected() -> None:
    answers = topic("/Rover/answer", "robot/answer", publisher="n")
    view = graph(answers, topic("/go", subscriber="n"))
    assert moving_topics(view, ()).robots_moved_by("/go") == ("Rover",)
    announced = graph(
        answers,
        topic("/go", subscriber="n"),
        topic("/Rover/description", "robot/description", publisher="n"),
    )
    assert (
        moving_topics(announced, [ROVER]).robots_moved_by("/go") == ()
    )  # its description lists the topics that move it


def test_topic_of_the_command_type_moves_a_robot_of_unknown_name() -> None:
    view = graph(
        topic("/Fido/go", "robot/command", subscriber="n"),
        patterns=(PatternInfo("/x/*", "robot/command", (SubscriberInfo(3, "n", 0, 0),)),),
    )
    moving = moving_topics(view, [ROVER])
    assert moving.robots_moved_by("/Fido/go", "json") == ("/Fido/go",)
    assert moving.robots_moved_by("/x/y") == ("/x/y",)
    assert moving_topics(view, [], own_nodes=["n"]).robots_moved_by("/x/y") == ()


def test_robots_of_original_nep_are_named_after_their_nodes() -> None:
    nodes = (
        NodeInfo("n", "pepper_driver", "", None, "python", "B", 0),
        NodeInfo("m", "me", "", None, "", "native", 0),
    )
    heard = TopicInfo("robot_action", "json", "json", (), tuple(SubscriberInfo(1, id, 0, 0) for id in "nm"))
    view = graph(heard, nodes=nodes)
    moving = moving_topics(view, original_robots(view))
    assert moving.robots_moved_by("robot_action") == ("pepper_driver",)
