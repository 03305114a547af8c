"""Tests of the tree of topics: folders, sums of their statistics, and the filter."""

from __future__ import annotations

import pytest

from app.core.network.topic_tree import (
    MAX_DEPTH,
    TopicFolder,
    TopicTree,
    TreeRow,
    folders_above,
    split_name,
    topic_filter,
)
from app.core.network.topics import Topic


def by_name(rows: list[TreeRow]) -> list[TreeRow]:
    return sorted(rows, key=lambda row: row.path if isinstance(row, TopicFolder) else row.name)


def keys(tree: TopicTree) -> list[str]:
    return [row.key for row in tree.rows(by_name)]


def test_folders_precede_their_topics_and_topic_may_have_folder_name() -> None:
    tree = TopicTree([Topic(name) for name in ("/b", "/a/y", "/a/x", "/a/x/deep", "/a")])
    assert keys(tree) == ["/a", "/a/*", "/a/x", "/a/x/*", "/a/x/deep", "/a/y", "/b"]
    assert [folder.depth for folder in tree] == [0, 1]


def test_collapsed_folder_hides_its_contents() -> None:
    topics = [Topic(name) for name in ("/a/x", "/a/b/y", "/c/z")]
    assert keys(TopicTree(topics, {"/a/*"})) == ["/a/*", "/c/*", "/c/z"]
    assert keys(TopicTree(topics, {"/a/b/*", "/never/*"})) == ["/a/*", "/a/b/*", "/a/x", "/c/*", "/c/z"]


def test_folder_sums_known_stats_of_live_topics() -> None:
    topics = [
        Topic("/a/x", rate_hz=10.0, bandwidth_Bps=100.0, age_s=3.0, lost=2),
        Topic("/a/b/y", rate_hz=5.5, age_s=1.0),
        Topic("/a/b/gone", rate_hz=99.0, lost=7, gone_s=2.0),
        Topic("/c/unknown"),
    ]
    tree = TopicTree(topics)
    figures = tree["/a/*"].stats
    assert (figures.rate_hz, figures.bandwidth_Bps, figures.age_s, figures.lost) == (15.5, 100.0, 1.0, 2)
    assert tree["/a/b/*"].stats.lost is None
    unknown = tree["/c/*"].stats
    assert (unknown.rate_hz, unknown.bandwidth_Bps, unknown.age_s, unknown.lost) == (None,) * 4
    topics[0].rate_hz = 20.0
    assert tree["/a/*"].stats.rate_hz == 15.5  # stats are cached until the next repaint
    tree.invalidate_stats()
    assert tree["/a/*"].stats.rate_hz == 25.5


def test_networks_have_separate_folders() -> None:
    tree = TopicTree([Topic("/a/x"), Topic("/a/x", network="ros2")])
    assert [folder.key for folder in tree] == ["/a/*", "ros2 /a/*"]
    assert [len(folder.topics) for folder in tree] == [1, 1]


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("/a/b", ("a", "b")),
        ("a", ("a",)),
        ("/a//b/", ("a", "b")),
        ("/", ("/",)),
        ("", ("",)),
        ("/" * 5, ("/////",)),
    ],
)
def test_unusual_topic_names_are_shown_as_rows(name, parts) -> None:
    assert split_name(name) == parts
    assert len(TopicTree([Topic(name)]).rows(by_name)) == len(parts)


def test_tree_depth_is_limited() -> None:
    name = "/x" * 10_000
    assert len(split_name(name)) == MAX_DEPTH + 1
    assert len(folders_above(name)) == MAX_DEPTH
    assert max(folder.depth for folder in TopicTree([Topic(name)])) == MAX_DEPTH - 1


def test_parent_folders_of_a_topic_are_listed() -> None:
    assert folders_above("/a/b/c") == ["/a/*", "/a/b/*"]
    assert folders_above("/a/b", "ros2") == ["ros2 /a/*"]
    assert folders_above("/a") == []


@pytest.mark.parametrize(
    ("words", "fit"),
    [
        ([], True),
        (["IMAGE", "depth"], True),
        (["image", "colour"], False),
        (["/robot/*"], True),
        (["/robot/?epth"], True),
        (["/robot"], True),
        (["robot/*"], False),
        (["*depth"], True),
        (["!image"], False),
        (["!json", "*"], True),
        (["!/robot/*"], False),
        (["!"], False),
        (["[d]epth*"], False),
        (["*" * 50 + "x"], False),
    ],
)
def test_filter_words_match_substrings_and_patterns_match_whole_name(words, fit) -> None:
    assert topic_filter(words)("/robot/depth", " /robot/depth image camera_driver") is fit
