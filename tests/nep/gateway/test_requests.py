from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.programs.gateway.requests import (
    Member,
    RequestError,
    encode_broadcast,
    encode_grant,
    encode_rejection,
    parse_request,
)
from tests import hostile

ASKED = {
    "node": "n1",
    "topic": "t1",
    "mode": "many2many",
    "socket": "publisher",
    "pid": 3346,
    "msg_type": "json",
}


def ask(port=7000, **changes):
    fields = {key: value for key, value in {**ASKED, **changes}.items() if value is not ...}
    return parse_request(json.dumps(fields).encode(), port)


def test_request_of_the_python_library_is_parsed():
    request = ask()
    assert (request.node, request.topic, request.socket, request.pid) == ("n1", "t1", "publisher", 3346)
    assert (request.generation, request.framing, request.codec) == ("A", "prefixed", "json")
    assert (ask(50000).generation, ask(50000).framing) == ("B", "bare")


@pytest.mark.parametrize(
    ("pid", "read"), [(7, 7), ("7", 7), ("none", None), (..., None), (True, None), (-1, None), (1e9, None)]
)
def test_process_id_may_be_a_number_a_string_or_missing(pid, read):
    assert ask(pid=pid).pid == read


def test_process_id_as_string_identifies_csharp():
    assert ask(pid="77").language == "csharp"
    assert ask(pid=77).language is None
    assert ask(language="C++").language == "c++"


def test_missing_type_and_mode_use_the_original_defaults():
    request = ask(msg_type=..., mode=...)
    assert (request.msg_type, request.mode) == ("json", "many2many")


def test_reply_has_the_shape_and_order_that_the_originals_expect():
    assert encode_grant(ask(), 9000) == (
        b'{"topic":"t1","port":9000,"mode":"many2many","ip":"127.0.0.1","socket":"publisher","state":"success"}'
    )
    assert b"mode" not in encode_grant(ask(socket="server"), 9000)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 60000, "not JSON"),
        (b"[]", "not a JSON object"),
        (b"{}", "no 'node'"),
        (json.dumps({**ASKED, "topic": 5}).encode(), "no 'topic'"),
        (json.dumps({**ASKED, "topic": "\ud800"}).encode(), "not text"),
        (json.dumps({**ASKED, "topic": "t" * 201}).encode(), "201 bytes"),
        (json.dumps({**ASKED, "socket": "nobody"}).encode(), "unknown socket 'nobody'"),
        (json.dumps({**ASKED, "mode": "all2all"}).encode(), "unknown mode 'all2all'"),
        (json.dumps({**ASKED, "msg_type": {}}).encode(), "no 'msg_type'"),
        (b" " * 70000, "at most"),
    ],
)
def test_invalid_request_receives_an_error_reply(data, sentence):
    with pytest.raises(RequestError, match=sentence) as caught:
        parse_request(data, 7000)
    answer = json.loads(encode_rejection(caught.value))
    assert answer["state"] == "failure"
    assert sentence in answer["error"]


def test_rejection_includes_the_topic_that_originals_compare():
    with pytest.raises(RequestError) as caught:
        ask(node=...)
    assert json.loads(encode_rejection(caught.value))["topic"] == "t1"


@given(st.binary(max_size=300))
def test_random_bytes_are_rejected_without_a_crash(data):
    with pytest.raises(RequestError) as caught:
        parse_request(data, 50000)
    assert json.loads(encode_rejection(caught.value))["state"] == "failure"


def test_broadcast_has_the_prefix_and_shape_of_the_originals():
    frame = encode_broadcast(
        [
            Member("t1", "n1", 9000, "publisher", "many2many", "json", 3346),
            Member("t1", "n2", 9000, "subscriber", "many2many", "json", None),
            Member("s", "n3", 9002, "server", None, "json", 1),
        ]
    )
    assert frame.startswith(b"master {")
    topics = json.loads(frame[len(b"master ") :])
    assert topics["t1"] == {
        "port": 9000,
        "socket": "publisher",
        "ip": "127.0.0.1",
        "mode": "many2many",
        "msg_type": "json",
        "nodes": {
            "n1": {"socket": "publisher", "pid": 3346, "ip": "127.0.0.1"},
            "n2": {"socket": "subscriber", "pid": None, "ip": "127.0.0.1"},
        },
    }
    assert "mode" not in topics["s"]
    assert encode_broadcast([]) == b"master {}"


def test_hostile_requests_are_granted_or_rejected_with_a_message():
    told = {
        "node": "n",
        "topic": "t",
        "socket": "publisher",
        "mode": "many2many",
        "msg_type": "json",
        "pid": 7,
    }
    answers = []
    for data in hostile.payloads(told):
        try:
            answers.append(encode_grant(parse_request(data, 7000), 9000))
        except RequestError as error:
            answers.append(encode_rejection(error))
    assert {json.loads(answer)["state"] for answer in answers} == {"success", "failure"}
    assert max(map(len, answers)) < 30_000
