"""Tests of the bridge configuration file: valid options, and errors with line and key."""

from __future__ import annotations

import re
import sys
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nep.backends import memory
from nep.errors import NepError
from nep.programs.bridges import (
    BridgeConfiguration,
    TopicEnd,
    configuration_from_arguments,
    read_configuration,
    side_configuration,
)
from nep.programs.bridges.toml_file import EXAMPLE, parse_configuration
from tests.examples import examples

SIDES = '[a]\nbackend = "zeromq"\n[b]\nbackend = "zenoh"\n'
ONE = '[[topics]]\na = "/t"\n'


def read(text):
    return parse_configuration(text, "lab.toml", "lab")


def error(text):
    with pytest.raises(NepError) as caught:
        read(text)
    return str(caught.value)


def test_every_side_option_is_parsed():
    told = read(
        """
        name = "robots"
        topics = [{a = "/free"}, {b = "only/b"}]
        [a]
        backend = "ZMQ"
        master = "10.0.0.7:7000"
        network = "lab"
        [b]
        backend = "zenoh"
        master = "tcp/10.0.0.8:7447"
        """
    )
    assert (told.name, told.a.backend.name, told.a.master, told.a.network) == (
        "robots", "zeromq", "10.0.0.7:7000", "lab",
    )  # fmt: skip
    assert (told.b.master, told.b.network) == ("tcp/10.0.0.8:7447", "zenoh:tcp/10.0.0.8:7447")
    assert [(each.a.name, each.b.name, each.direction) for each in told.topics] == [
        ("/free", "/free", "both"), ("only/b", "only/b", "both"),
    ]  # fmt: skip
    assert told.node_name("a") == "bridge-robots-to-zenoh"
    assert told.node_name("b") == "bridge-robots-to-zeromq"


def test_names_direction_rate_and_types_of_a_topic_are_parsed():
    (told,) = read(
        f'{SIDES}[[topics]]\na = "/a/*"\nb = "b/*/x"\ndirection = "b->a"\nmax_rate_hz = 2\ntype = "json"\n'
        'b_type = "string"\n'
    ).topics
    assert told.a == TopicEnd("/a/*", "json")
    assert told.b == TopicEnd("b/*/x", "string")
    assert (told.direction, told.origins, told.max_rate_hz, told.is_pattern) == ("b->a", ("b",), 2.0, True)


def test_default_name_is_the_file_name(tmp_path):
    path = tmp_path / "my lab.toml"
    path.write_text("\ufeff" + SIDES + ONE, encoding="utf-8")
    assert read_configuration(path).name == "my lab"


def test_example_file_is_valid(monkeypatch):
    """ROS may not be installed, so only the text is parsed."""
    text = EXAMPLE.replace('backend = "ros"', 'backend = "zenoh"')
    told = read(text)
    assert [each.direction for each in told.topics] == ["both", "a->b", "b->a", "b->a"]
    assert told.topics[1].b.msg_type == "geometry_msgs/Twist"
    shown = re.sub(r"(?m)^# (?=\w+ = )", "", text).replace("b_qos", "# b_qos")
    told = read(shown)
    assert (told.name, told.a.network, told.topics[2].a.msg_type) == ("lab", "lab", "image")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "'lab.toml', a: the side 'a' is missing; write [a] and backend = \"zeromq\" below it"),
        ("[a]\n", "line 1 of 'lab.toml', a.backend: the back end is missing; write backend = \"zeromq\""),
        ('[a]\nbackend = "zeromk"\n', "line 2 of 'lab.toml', a.backend: unknown back end 'zeromk'; did you"),
        ("a = 7\n", "line 1 of 'lab.toml', a: the side 'a' is missing"),
        ('[a]\nbackend = "zeromq"\nmaster = "a b"\n', "line 3 of 'lab.toml', a.master: 'a b:7780' isn't"),
        ('a.backend = "zeromq"\na.master = "²:²"\n', "line 2 of 'lab.toml', a.master: '²:²' isn't a val"),
        ('[a]\nbackend = "zeromq"\n[b]\nbackend = "zmq"\n' + ONE, "line 3 of 'lab.toml', b: both sides are"),
        (SIDES, "'lab.toml', topics: no topics are listed; write [[topics]] and a = \"/a/topic\" below it"),
        (SIDES + "[topics]\na = 1\n", "line 5 of 'lab.toml', topics: no topics are listed; write [["),
        (SIDES + "[[topics]]\n", "line 5 of 'lab.toml', topics[1].a: the topic name is missing; write a ="),
        (SIDES + ONE + "max_rate = 5\n", "line 7 of 'lab.toml', topics[1].max_rate: unknown key; did you"),
        ('nam = "x"\n', "line 1 of 'lab.toml', nam: unknown key; did you mean 'name'?"),
        ("name = 7\n", "line 1 of 'lab.toml', name: must be a string in quotes"),
        ('name = "a\\nb"\n', "line 1 of 'lab.toml', name: 'bridge-a\\nb' isn't a valid node name"),
        (f'name = "{"x" * 61}"\n', "line 1 of 'lab.toml', name: a bridge's name must have 1 to 60 char"),
        ('name = ""\n', "line 1 of 'lab.toml', name: a bridge's name must have 1 to 60 char"),
        (SIDES + '[[topics]]\na = "x y"\n', "line 6 of 'lab.toml', topics[1].a: 'x y' isn't a valid"),
        (SIDES + '[[topics]]\na = "/*"\nb = "/b"\n', "line 7 of 'lab.toml', topics[1].b: '/*' and '/b' have"),
        (SIDES + '[[topics]]\na = "/*/*"\n', "line 6 of 'lab.toml', topics[1].a: '/*/*' has 2 wildcards"),
        (SIDES + ONE + 'direction = "a=>b"\n', "line 7 of 'lab.toml', topics[1].direction: unknown dir"),
        (SIDES + ONE + "max_rate_hz = 0\n", "line 7 of 'lab.toml', topics[1].max_rate_hz: must be a num"),
        (SIDES + ONE + "max_rate_hz = nan\n", "topics[1].max_rate_hz: must be a number"),
        (SIDES + ONE + "max_rate_hz = inf\n", "topics[1].max_rate_hz: must be a number"),
        (SIDES + ONE + "max_rate_hz = -1\n", "topics[1].max_rate_hz: must be a number"),
        (SIDES + ONE + "max_rate_hz = true\n", "topics[1].max_rate_hz: must be a number"),
        (SIDES + ONE + f"max_rate_hz = {10**400}\n", "topics[1].max_rate_hz: must be a number"),
        (SIDES + ONE + 'a_type = ""\n', "line 7 of 'lab.toml', topics[1].a_type: a_type is empty; use"),
        (SIDES + ONE + 'type = "a\\u0007"\n', "line 7 of 'lab.toml', topics[1].type: type is 'a\\x07'; use"),
        (SIDES + ONE + 'b_qos = "fast"\n', "topics[1].b_qos: the back end 'zenoh' doesn't support"),
        (SIDES + ONE + "\n# a comment\n" + ONE, "line 10 of 'lab.toml', topics[2].a: '/t' is already"),
        (SIDES + ONE + "[c]\n", "line 7 of 'lab.toml', c: unknown key; known names: 'name', 'a', 'b',"),
        ("x = [\n", "line 2 of 'lab.toml' isn't valid TOML: invalid value; 'nep bridge --example' prints"),
        ("a = 1\na = 2\n", "of 'lab.toml' isn't valid TOML: cannot overwrite a value"),
        (f"a = {'[' * 5000}", "line 1 of 'lab.toml' isn't valid TOML: "),
        (f"a = {'9' * 5000}", "line 1 of 'lab.toml' isn't valid TOML: "),
        (SIDES + '[[topics]]\na = "/t"\n' * 1001, "'lab.toml', topics: there are more than 1000"),
    ],
)  # fmt: skip
def test_invalid_configuration_is_rejected_with_line_and_key(text, said):
    found = error(text)
    assert said in found
    assert "\n" not in found


def test_qos_values_of_the_back_end_are_accepted_and_unknown_ones_rejected(monkeypatch):
    from dataclasses import replace

    told = replace(memory.BACKEND, qos=("reliable", "sensor"))
    monkeypatch.setattr("nep.programs.bridges.configuration.find_backend", lambda _name: told)
    sides = SIDES.replace('"zenoh"\n', '"zenoh"\nmaster = "other"\n')
    assert read(sides + ONE + 'b_qos = "sensor"\n').topics[0].b.qos == "sensor"
    assert "unknown quality of service 'sensors'; did you mean 'sensor'?" in error(
        sides + ONE + 'b_qos = "sensors"\n'
    )


A_FOLDER = "permission denied" if sys.platform == "win32" else "is a directory"  # the system's error text
NUL = "character" if sys.platform == "win32" else "byte"  # Python's word on that platform


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: path, "can't be read: no such file"),
        (lambda path: path.parent, f"can't be read: {A_FOLDER}"),
        (lambda path: path.with_name("x\0y"), f"can't be read: embedded null {NUL}"),
        (lambda path: written(path, b"name = 1 \xff"), "line 1 of "),
        (lambda path: written(path, b"# \n# \xff"), "isn't UTF-8; save the file as UTF-8"),
        (
            lambda path: written(path, b"#" * 1_000_001),
            "is too large for a bridge file (limit: 1000000 bytes)",
        ),
    ],
)
def test_unreadable_file_is_reported(tmp_path, make, said):
    with pytest.raises(NepError) as caught:
        read_configuration(make(tmp_path / "lab.toml"))
    assert said in str(caught.value)


def written(path, data):
    path.write_bytes(data)
    return path


# ---- arbitrary contents


scalars = st.one_of(
    st.text(max_size=20), st.integers(), st.floats(), st.booleans(), st.dates(), st.times(), st.datetimes(),
    st.sampled_from(["zeromq", "zenoh", "memory", "/t", "/t/*", "**", "both", "a->b", "json", "", "lab"]),
)  # fmt: skip
words = st.sampled_from(
    ["a", "b", "name", "topics", "backend", "master", "network", "direction", "max_rate_hz", "type", "a_type",
     "b_type", "a_qos", "b_qos", "x", ""]
)  # fmt: skip
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(words | st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=12,
)


def toml(value):
    """Return a value in TOML format."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(letter):08x}" for letter in value) + '"'
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {toml(each)}" for key, each in value.items()) + "}"
    return value.isoformat() if hasattr(value, "isoformat") else repr(value)


def reads_or_says(text):
    try:
        found = parse_configuration(text, "lab.toml", "lab")
    except NepError as caught:
        said = str(caught)
        assert "lab.toml" in said
        assert "\n" not in said
        return
    assert isinstance(found, BridgeConfiguration)
    assert found.topics


@settings(max_examples=examples(400), deadline=None)
@given(st.dictionaries(words, values, max_size=4))
def test_any_toml_is_parsed_or_rejected_with_a_message(table):
    reads_or_says("".join(f"{toml(key)} = {toml(value)}\n" for key, value in table.items()))


@settings(max_examples=examples(400), deadline=None)
@given(
    st.lists(st.dictionaries(words, scalars, max_size=4), min_size=1, max_size=3),
    st.dictionaries(words, scalars),
)
def test_any_topics_and_sides_are_parsed_or_rejected_with_a_message(topics, side):
    head = f'topics = {toml(topics)}\na = {toml({"backend": "zeromq", **side})}\nb.backend = "zenoh"\n'
    reads_or_says(head)


@settings(max_examples=examples(300), deadline=None)
@given(st.text(max_size=200))
def test_any_configuration_text_is_parsed_or_rejected_with_a_message(text):
    reads_or_says(text)
    reads_or_says(SIDES + ONE + text)


@settings(max_examples=examples(300), deadline=None)
@given(st.text(max_size=30), st.text(max_size=30))
def test_any_two_side_arguments_are_parsed_or_rejected_with_a_message(a, b):
    for pair in ((a, b), (f"zeromq:{a}", f"zenoh:{b}"), (f"zeromq@{a}:/t", f"zenoh@{b}:/t")):
        with suppress(NepError):
            assert isinstance(configuration_from_arguments(*pair, name="1"), BridgeConfiguration)


# ---- names


@pytest.mark.parametrize(
    ("pattern", "topic", "part"),
    [
        ("/a/*", "/a/b", "b"), ("/a/*", "/a/b/c", ""), ("/a/**", "/a/b/c", "b/c"), ("/a/*", "/a/", ""),
        ("/a/*", "/b/b", ""), ("*", "x", "x"), ("**", "/x/y", "/x/y"), ("/*/odom", "/r1/odom", "r1"),
        ("/*/odom", "/odom", ""), ("/aa*aa", "/aaa", ""), ("/aa*aa", "/aaxaa", "x"), ("/a.*", "/axb", ""),
        ("/x", "/x", ""), ("/ü*", "/üß", "ß"),
    ],
)  # fmt: skip
def test_wildcard_captures_part_of_a_topic(pattern, topic, part):
    end = TopicEnd(pattern)
    assert end.matched_part(topic) == part
    if part:
        assert end.with_part(part) == topic


@settings(max_examples=examples(300), deadline=None)
@given(st.sampled_from(["/a/*", "/*/b", "x**", "**/y", "*"]), st.text("ab/xy*", min_size=1, max_size=8))
def test_wildcard_substitution_round_trips(pattern, part):
    end = TopicEnd(pattern)
    found = end.matched_part(end.with_part(part))
    assert found == ("" if end.wildcard == "*" and "/" in part else part)


@pytest.mark.parametrize(
    ("a", "b", "found"),
    [
        ("zeromq:/t", "zenoh:", ("127.0.0.1:7780", "/t", "local", "/t")),
        ("zmq@10.0.0.1:70:/t", "zenoh@tcp/10.0.0.2:74:/u", ("10.0.0.1:70", "/t", "tcp/10.0.0.2:74", "/u")),
        ("zmq@10.0.0.1:", "zenoh@local/x:/u", ("10.0.0.1:7780", "/u", "local/x", "/u")),
        ("memory:/a@b", "zenoh:/a:b", ("memory", "/a@b", "local", "/a:b")),
    ],
)  # fmt: skip
def test_side_argument_is_parsed_into_master_and_topic(monkeypatch, a, b, found):
    monkeypatch.delenv("NEP_MASTER", raising=False)
    told = configuration_from_arguments(a, b, name="1")
    assert (told.a.master, told.topics[0].a.name, told.b.master, told.topics[0].b.name) == found


def test_local_network_name_includes_the_computer_or_process():
    import os
    import platform

    assert (
        side_configuration("zeromq", "127.0.0.1:7780").network == f"zeromq:127.0.0.1:7780@{platform.node()}"
    )
    assert side_configuration("zeromq", "10.0.0.1:7780").network == "zeromq:10.0.0.1:7780"
    assert side_configuration("zenoh", "local/x").network == f"zenoh:local/x@{platform.node()}"
    assert side_configuration("zenoh", "zenoh.json5").network == f"zenoh:zenoh.json5@{platform.node()}"
    assert (
        side_configuration("zenoh", "tcp/10.0.0.1:7447,tcp/b:7447").network
        == "zenoh:tcp/10.0.0.1:7447,tcp/b:7447"
    )
    assert (
        side_configuration("zenoh", "tcp/127.0.0.1:7447").network
        == f"zenoh:tcp/127.0.0.1:7447@{platform.node()}"
    )
    assert side_configuration("zeromq", "localhost").network == f"zeromq:localhost:7780@{platform.node()}"
    assert side_configuration("zeromq", "robot.local").network == "zeromq:robot.local:7780"
    assert side_configuration("memory", "x").network == f"memory:x@{platform.node()}/{os.getpid()}"
