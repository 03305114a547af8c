"""Tests of field paths and of tables of selected fields."""

from __future__ import annotations

import csv
import io

import orjson
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

import nep
from nep.cli.topics.echo import echo
from nep.cli.topics.table_file import CsvMessageWriter, FieldExtractor
from nep.errors import NepError
from nep.messages.fields import MISSING, leaf_paths, parse_path, path_text, value_at
from nep.messages.message import Message

ODOM = {"pose": {"x": 1.5, "y": None}, "joints": [0.1, 0.2, {"name": 'knee "left", bent'}], "a key": True}


def message(payload, stamp_ns=1_700_000_000_000_000_001, codec="json", **more):
    data = payload if isinstance(payload, bytes) else orjson.dumps(payload)
    return Message("t", data, codec, codec, stamp_ns=stamp_ns, **more)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("pose.x", 1.5),
        ("joints[1]", 0.2),
        ("joints[-3]", 0.1),
        ("joints[2].name", 'knee "left", bent'),
        ('["a key"]', True),
        ("pose.y", None),
        (".", ODOM),
        ("pose.z", MISSING),
        ("joints[3]", MISSING),
        ("joints.x", MISSING),
        ("pose[0]", MISSING),
        ("pose.x.deeper", MISSING),
    ],
)
def test_field_path_selects_a_value(text, value):
    assert value_at(ODOM, parse_path(text)) == value


@given(st.lists(st.integers(-(10**6), 10**6) | st.text(), max_size=5))
def test_formatted_field_path_parses_back_to_the_same_path(steps):
    assert parse_path(path_text(tuple(steps))) == tuple(steps)


@pytest.mark.parametrize("text", ["", "joints[x]", "joints[", "a..b", "a.", "]", 'a["b'])
def test_malformed_field_path_is_rejected(text):
    with pytest.raises(NepError, match="field"):
        parse_path(text)


def test_leaves_yield_the_path_of_every_leaf_value():
    paths = list(leaf_paths(ODOM))
    assert paths == ["pose.x", "pose.y", "joints[0]", "joints[1]", "joints[2].name", '["a key"]']
    assert list(leaf_paths(7)) == ["."]
    assert len(list(leaf_paths(list(range(5)) * 100, max_count=3))) == 3


@given(
    st.recursive(
        st.none() | st.integers() | st.text(),
        lambda inner: st.dictionaries(st.text(), inner, max_size=3) | st.lists(inner, max_size=3),
        max_leaves=8,
    )
)
def test_leaf_paths_of_any_payload_resolve_to_a_value(payload):
    for path in leaf_paths(payload):
        assert value_at(payload, parse_path(path)) is not MISSING


def rows(out):
    return list(csv.reader(io.StringIO(out, newline="")))


def test_csv_table_has_header_time_stamps_and_quoted_cells():
    out = io.StringIO(newline="")
    table = CsvMessageWriter(FieldExtractor(["pose.x", "joints[2].name", "a", "."]), out)
    table(message({"pose": {"x": 1.5}, "joints": [0, 0, {"name": 'say "hi",\nbye'}], "a": False}))
    table(message({"a": None}, stamp_ns=None))
    text = out.getvalue()
    assert text.startswith("stamp_s,pose.x,joints[2].name,a,.\r\n")
    assert '"say ""hi"",\nbye"' in text
    head, first, second = rows(text)
    assert first[:4] == ["1700000000.000000001", "1.5", 'say "hi",\nbye', "false"]
    assert orjson.loads(first[4])["pose"] == {"x": 1.5}
    assert second == ["", "", "", "", '{"a":null}']
    assert len(head) == 5


def test_missing_fields_and_undecodable_messages_are_counted(capsys):
    fields = FieldExtractor(["x", "y"])
    table = CsvMessageWriter(fields, io.StringIO())
    for each in (message({"x": 1}), message({"x": 1, "y": 2}), message(b"{oops"), message({})):
        table(each)
    fields.report_missing()
    said = capsys.readouterr().err
    assert "'x' was missing in 1 of 3 messages" in said
    assert "'y' was missing in 2 of 3 messages" in said
    assert "skipped 1 undecodable message" in said


def test_shape_is_a_field_of_image_messages():
    fields = FieldExtractor(["shape[0]"])
    picture = message(b"\xff", codec="image", extension={"shape": [240, 320, 3]})
    assert fields.extract(picture) == [240]


@pytest.fixture
def odom(master):
    with nep.node("talker") as node:
        node.new_pub("/odom", latched=True).publish(ODOM)
        yield master.address


def test_echo_writes_csv(odom, capfd):
    echo("/odom", ["pose.x", "pose.z"], 1, None, odom, as_json=False, as_csv=True)
    shown = capfd.readouterr()
    head, row = rows(shown.out)
    assert head == ["stamp_s", "pose.x", "pose.z"]
    assert row[1:] == ["1.5", ""]
    assert float(row[0]) > 1_700_000_000
    assert "'pose.z' was missing in 1 of 1 messages" in shown.err


def test_echo_prints_selected_fields_as_text_and_json(odom, capfd):
    echo("/odom", ["pose.x"], 1, None, odom)
    assert '{"pose.x":1.5}' in capfd.readouterr().out
    echo("/odom", ["pose.x", "no"], 1, None, odom, as_json=True)
    record = orjson.loads(capfd.readouterr().out)
    assert (record["fields"], record["seq"]) == ({"pose.x": 1.5}, 1)
    assert "payload" not in record


def test_conflicting_or_invalid_echo_options_are_rejected(odom):
    with pytest.raises(typer.BadParameter, match="specify the fields"):
        echo("/odom", None, 1, None, odom, as_csv=True)
    with pytest.raises(typer.BadParameter, match="choose one"):
        echo("/odom", ["x"], 1, None, odom, as_json=True, as_csv=True)
    with pytest.raises(
        NepError, match="'x\\[' isn't a valid field path; use a path such as 'pose\\.x' or 'joints\\[3\\]'"
    ):
        echo("/odom", ["x["], 1, None, odom, as_csv=True)


def test_echo_waits_for_an_unknown_topic_and_suggests_a_similar_name(odom, capfd):
    with pytest.raises(nep.WaitTimeoutError):
        echo("/odm", None, 1, 0.1, odom)
    assert "did you mean '/odom'?" in capfd.readouterr().err
