"""Tests of the generated wire vectors: they are up to date, and encoders and decoders agree with them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from nep.errors import WireError
from nep.messages.packing import unpack
from nep.protocol import wire
from nep.protocol.batch import parse_parts
from nep.protocol.encoding import decode_reply, decode_request, encode_reply, encode_request
from tests.nep.protocol import wire_tables
from tools import wire_vectors

ROOT = Path(__file__).parents[3]
DATA = ROOT / "tests" / "data" / "wire"
FILTERS: list[dict[str, Any]] = json.loads((DATA / "filters.json").read_text("utf-8"))
NOTICES: list[dict[str, Any]] = json.loads((DATA / "notices.json").read_text("utf-8"))
MASTER: dict[str, Any] = json.loads((DATA / "master.json").read_text("utf-8"))
MALFORMED: list[list[str]] = json.loads((DATA / "malformed.json").read_text("utf-8"))
BATCHES: list[dict[str, Any]] = json.loads((DATA / "batches.json").read_text("utf-8"))


def name_of(vector: dict[str, Any]) -> str:
    return str(vector["name"])


def code_of(parts: list[bytes]) -> str:
    with pytest.raises(WireError) as refused:
        parse_parts(parts)
    return refused.value.code


def test_generated_vectors_are_up_to_date() -> None:
    for name, text in wire_vectors.files().items():
        assert (DATA / name).read_text("utf-8") == text, f"{name}: run python tools/wire_vectors.py"


def test_each_generated_malformed_message_is_rejected_with_its_error_code() -> None:
    assert len({tuple(parts) for _code, *parts in MALFORMED}) == wire_vectors.MALFORMED_COUNT
    wrong = [
        (code, found, parts)
        for code, *parts in MALFORMED
        if (found := code_of([bytes.fromhex(part) for part in parts])) != code
    ]
    assert wrong == []


@pytest.mark.parametrize("vector", BATCHES, ids=name_of)
def test_batch_is_decoded_or_rejected_with_its_error_code(vector: dict[str, Any]) -> None:
    part = bytes.fromhex(vector["part"])
    if "error" in vector:
        assert code_of([part]) == vector["error"]
        return
    for read, means in zip(parse_parts([part]), vector["means"], strict=True):
        assert bytes(read.payload).hex() == means["payload"]
        assert (str(read.header.seq), str(read.header.stamp_ns)) == (means["seq"], means["stamp_ns"])
        assert str(read.header.publisher) == means["publisher"]


@pytest.mark.parametrize("vector", FILTERS, ids=name_of)
def test_subscription_filter_is_parsed_and_encoded_or_rejected(vector: dict[str, Any]) -> None:
    part = bytes.fromhex(vector["filter"])
    hello, read, shares = (
        wire.parse_hello(part),
        wire.parse_acknowledgement(part),
        wire.parse_acceptance(part),
    )
    if "error" in vector:
        assert (hello, read, shares) == (None, None, None)
        return
    said = vector["means"]
    kind = said.pop("kind")
    if kind == "topic":
        assert wire.topic_part(said["topic"]) == part
    elif kind == "hello":
        assert hello is not None
        level = hello.reads_one_part + hello.acknowledges_echoes + hello.reads_batches
        assert (str(hello.subscriber), hello.topic, level) == (
            said["subscriber"],
            said["topic"],
            said["level"],
        )
        again = wire.hello_part(
            *hello[:2], reads_one_part=level > 0, acknowledges_echoes=level > 1, reads_batches=level > 2
        )
        assert again == part
    elif kind == "read":
        assert read is not None
        assert wire_vectors.as_text(read._asdict()) == said
        assert wire.acknowledgement_part(read) == part
    else:
        assert shares is not None
        assert wire_vectors.as_text(shares._asdict()) == said
        assert wire.acceptance_part(shares) == part


@pytest.mark.parametrize("vector", [*MASTER["asked"], *MASTER["pushed"]], ids=name_of)
def test_request_reply_and_push_are_decoded_and_encoded(vector: dict[str, Any]) -> None:
    request = bytes.fromhex(vector["request"])
    received = decode_request(request)
    assert not isinstance(received.request, WireError)
    assert encode_request(received.request, received.call) == request
    body = bytes.fromhex(vector.get("answer") or vector["push"])
    call, answer = decode_reply(body)
    assert encode_reply(answer, call) == body
    assert wire_vectors.as_text(unpack(body)) == (vector.get("answer_means") or vector["means"])


def test_documentation_lists_every_error_code() -> None:
    page = (ROOT / "docs" / "wire.md").read_text("utf-8")
    listed = set(re.findall(r"^\| `([a-z-]+)` \|", page.partition("## Error codes")[2], re.MULTILINE))
    sources = [
        *(ROOT / "nep" / "protocol").glob("*.py"),
        *(ROOT / "nep" / "masters").glob("*.py"),
        *(ROOT / "nep" / "backends" / "zeromq").rglob("*.py"),
    ]
    raised = {
        code for each in sources for code in re.findall(r'code="([a-z-]+)"', each.read_text(encoding="utf-8"))
    }
    in_vectors = {code for code, *_parts in MALFORMED} | {
        each["error"] for each in FILTERS if "error" in each
    }
    assert raised | in_vectors <= listed


@pytest.mark.parametrize("name", [name for name in wire_tables.TABLES if wire_tables.rows(name)])
def test_documentation_has_types_and_defaults_of_all_wire_fields(name: str) -> None:
    page = (ROOT / "docs" / "wire.md").read_text("utf-8")
    table = page.partition(f"\n#### `{name}`\n")[2].partition("\n#")[0]
    found = re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \|", table, re.MULTILINE)
    assert found == wire_tables.rows(name)
