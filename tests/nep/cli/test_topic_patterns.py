"""Tests of topic patterns: which topics match, and how `nep topic echo` shows topics that appear later."""

from __future__ import annotations

import json

import pytest

import nep
from nep.cli.topics.topic_patterns import TopicPatterns, is_pattern, matches
from tests.nep.cli.test_command import Running


@pytest.mark.parametrize(
    ("pattern", "topics"),
    [
        ("/*/odom", ["/a/odom"]),
        ("/**/odom", ["/odom", "/a/odom", "/a/b/odom"]),
        ("/a/**", ["/a", "/a/odom", "/a/b/odom"]),
        ("**", ["/odom", "/a", "/a/odom", "/a/b/odom", "words", "w.rds"]),
        ("*", ["words", "w.rds"]),
        ("w?rds", ["words", "w.rds"]),
        ("w.rds*", ["w.rds"]),
        ("/**/b/**/**", ["/a/b/odom"]),
        ("/od*m", ["/odom"]),
        ("/x*", []),
    ],
)
def test_pattern_matches_topics(pattern, topics):
    known = ["/odom", "/a", "/a/odom", "/a/b/odom", "words", "w.rds"]
    assert [each for each in known if matches(pattern, each)] == topics


def test_pattern_of_many_stars_is_matched_quickly():
    assert not matches("/**" * 60 + "/x", "/a" * 60)


@pytest.mark.parametrize(
    ("word", "is_one"), [("/a/*", True), ("a?", True), ("/a", False), ('["*"]', False), ("a[3].*", False)]
)
def test_topic_patterns_are_distinguished_from_topics_and_field_paths(word, is_one):
    assert is_pattern(word) is is_one


def test_each_new_topic_is_reported_once_and_a_pattern_without_matches_once(capfd):
    with nep.node("n", "memory", master="patterns") as node:
        node.new_pub("/a/odom")
        node.new_sub("/b/odom")
        patterns = TopicPatterns(node, ["/*/odom", "/none/*"], ["/known/odom"])
        node.new_pub("/known/odom")
        assert patterns.new_topics(node.graph()) == [("/a/odom", "json")]
        assert patterns.new_topics(node.graph()) == []
        node.new_pub("/b/odom", "msgpack")
        assert patterns.new_topics(node.graph()) == [("/b/odom", "msgpack")]
    assert capfd.readouterr().err.count("no topic matches '/none/*' yet") == 1


def test_echo_shows_matching_topics_that_appear_later(master):
    echo = Running("topic", "echo", "/*/odom", "--json", "--count", "2")
    try:
        assert "no topic matches '/*/odom' yet" in echo.wait_says("matches")
        with nep.node("robot") as node:
            for name in ("/a/odom", "/b/odom"):
                node.new_pub(name, latched=True).publish({"of": name})
                record = json.loads(echo.process.stdout.readline())
                assert (record["topic"], record["payload"]) == (name, {"of": name})
        assert echo.process.wait(60) == 0
    finally:
        echo.close()
