"""Tests of `nep service list`, `info` and `call`."""

from __future__ import annotations

import json
import threading

import pytest

import nep
from nep.cli.complete import complete_service
from nep.cli.screen import UNKNOWN
from tests.nep.meeting import place_for
from tests.nep.programs import eventually

SERVICE = "/arm/move"


@pytest.fixture
def arm(master):
    """Server that the node "page" has called twice: one call succeeded, the other failed."""

    def answer(request):
        if request == "bad":
            raise LookupError("no such joint")
        return {"asked": request}

    with nep.node("arm") as node, nep.node("page") as page:
        server = node.new_server(SERVICE, answer, threads=1)
        client = page.new_client(SERVICE, timeout_s=30.0)
        client.call(1)
        with pytest.raises(nep.ServiceError):
            client.call("bad")
        eventually(lambda: master.view().services[SERVICE].errors == 1)
        eventually(lambda: master.view().services[SERVICE].clients[0].answered == 2)
        yield server


def rows(out):
    return [line.split() for line in out.splitlines()]


def test_list_has_servers_clients_and_counts(arm, type_in):
    code, out, err = type_in("service", "list")
    assert (code, err) == (0, "")
    assert [SERVICE, "arm", "page", "2", "1"] in rows(out)
    (told,) = json.loads(type_in("service", "list", "--json")[1])
    assert (told["name"], told["calls"], told["errors"]) == (SERVICE, 2, 1)
    assert isinstance(told["servers"][0]["id"], str)


def test_empty_service_list_is_explained(master, type_in):
    code, out, err = type_in("service", "list")
    assert (code, out) == (0, "")
    assert "no services" in err
    assert type_in("service", "list", "--json")[:2] == (0, "[]\n")


def test_topics_and_services_are_listed_separately(arm, type_in):
    assert SERVICE not in type_in("topic", "list")[1]
    assert json.loads(type_in("topic", "list", "--json")[1]) == []
    nodes = {each["name"]: each for each in json.loads(type_in("node", "list", "--json")[1])}
    assert (nodes["arm"]["serves"], nodes["arm"]["calls"], nodes["arm"]["publishes"]) == ([SERVICE], [], [])
    assert (nodes["page"]["serves"], nodes["page"]["calls"], nodes["page"]["subscribes"]) == (
        [],
        [SERVICE],
        [],
    )
    head, *_lines = rows(type_in("node", "list")[1])
    assert head[-2:] == ["serves", "calls"]


def test_service_info_type_and_find_commands_print_the_service(arm, type_in):
    code, out, _err = type_in("service", "info", SERVICE)
    assert code == 0
    assert out.startswith(
        f"service: {SERVICE}\ntype: any (each client chooses json or msgpack)\nanswered: 2\nerrors: 1\n\n"
    )
    assert any(row[:4] == ["arm", "serves", "2", "1"] and row[-1] == arm.endpoints[0] for row in rows(out))
    assert any(row[:4] == ["page", "calls", "2", "0"] for row in rows(out))
    record = json.loads(type_in("service", "info", SERVICE, "--json")[1])
    assert [each["node"] for each in record["servers"]] == ["arm"]
    assert [each["node"] for each in record["clients"]] == ["page"]
    assert type_in("service", "type", SERVICE)[:2] == (0, "any (each client chooses json or msgpack)\n")
    msg_type = json.loads(type_in("service", "type", SERVICE, "--json")[1])["msg_type"]
    assert json.loads(type_in("service", "find", msg_type, "--json")[1]) == [SERVICE]
    code, out, err = type_in("service", "find", "std_srvs/SetBool")
    assert (code, out) == (0, "")
    assert "'std_srvs/SetBool'" in err


def test_two_servers_of_a_service_are_reported_with_the_list(arm, type_in):
    with nep.node("other") as node:
        node.new_server(SERVICE, lambda request: request, threads=1)
        assert "has 2 servers" in type_in("service", "list")[2]
        assert "has 2 servers" in type_in("service", "info", SERVICE)[2]


def test_call_prints_the_reply(arm, type_in, tmp_path):
    assert type_in("service", "call", SERVICE, '{"joint": 1}') == (0, '{"asked":{"joint":1}}\n', "")
    assert type_in("service", "call", SERVICE) == (0, '{"asked":{}}\n', "")
    assert type_in("service", "call", SERVICE, "[1, null]", "--json") == (0, '{"asked":[1,null]}\n', "")
    file = tmp_path / "request.json"
    file.write_text('"grüß"', encoding="utf-8")
    assert json.loads(type_in("service", "call", SERVICE, f"@{file}")[1]) == {"asked": "grüß"}


def test_service_command_errors_are_reported_in_one_sentence(arm, type_in, tmp_path, monkeypatch):
    monkeypatch.setattr("nep.patterns.services.client._SERVICE_QUERY_TIMEOUT_S", 30.0)
    for words, sentence in (
        ((SERVICE, '"bad"'), f"the server of '{SERVICE}' failed: LookupError: no such joint"),
        (
            ("/arm/mov", "{}", "--timeout", "0.1"),
            "no server for '/arm/mov' within 0.1 s; did you mean '/arm/move'?",
        ),
        ((SERVICE, "{oops"), "'{oops' isn't valid JSON: line 1, column 2: "),
        (("bad name", "{}"), "topic"),
        ((SERVICE, f"@{tmp_path / 'none'}"), "can't read"),
    ):
        code, out, err = type_in("service", "call", *words)
        assert (code, out) == (1, "")
        assert err.startswith("nep: ")
        assert sentence in err
        assert err.count("\n") == 1
    for wrong in ("-1", "nan", "soon"):
        assert type_in("service", "call", SERVICE, "{}", "--timeout", wrong)[0] == 2
    sentence = "no service '/arm/mvoe'; did you mean '/arm/move'? 'nep service list' shows all services"
    assert type_in("service", "info", "/arm/mvoe") == (1, "", f"nep: {sentence}\n")
    assert type_in("service", "info", "bad name")[0] == 1


def test_missing_master_is_reported(monkeypatch, type_in):
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")
    for words in (("list",), ("call", SERVICE)):
        code, out, err = type_in("service", *words)
        assert (code, out) == (1, "")
        assert "127.0.0.1:1" in err


def test_call_waits_for_a_server_that_starts_later(master, type_in):
    made = []

    def come():
        eventually(lambda: "/late" in master.view().services)
        made.append(nep.node("late"))
        made[0].new_server("/late", lambda request: "here", threads=1)

    coming = threading.Thread(target=come, name="coming")
    coming.start()
    assert type_in("service", "call", "/late", "{}", "--timeout", "30") == (0, '"here"\n', "")
    coming.join(30.0)
    made[0].close()


def test_service_names_are_completed(arm, master):
    class Context:
        params = {"master": master.address}  # noqa: RUF012 - as typer has it

    assert complete_service(Context(), "/arm") == [SERVICE]
    assert complete_service(Context(), "/leg") == []


@pytest.mark.usefixtures("patient")
def test_services_of_another_back_end_are_listed_and_called(type_in, monkeypatch):
    monkeypatch.setattr("nep.patterns.services.client._SERVICE_QUERY_TIMEOUT_S", 30.0)
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")  # an address of another back end is ignored
    monkeypatch.setenv("NEP_ZENOH_CONFIG", place_for("zenoh", ""))
    place = place_for("zenoh", "")
    there = ("--backend", "zenoh", "--master", place)
    with nep.node("arm", "zenoh", master=place) as node:
        node.new_server(SERVICE, lambda request: {"asked": request}, threads=1)
        code, out, err = type_in("service", "call", SERVICE, '{"n": 1}', "--json", *there)
        assert (code, json.loads(out), err) == (0, {"asked": {"n": 1}}, "")
        code, out, err = type_in("service", "list", *there)
        assert (code, err) == (0, "")
        assert [SERVICE, "arm", UNKNOWN, "1", "0"] in rows(out)
        code, out, err = type_in("service", "info", SERVICE, "--json", *there)
        assert (code, [each["node"] for each in json.loads(out)["servers"]], err) == (0, ["arm"], "")
        code, out, err = type_in("service", "call", "/arm/mov", "--timeout", "0.1", *there)
        assert code == 1
        assert "no server for '/arm/mov' within 0.1 s; did you mean '/arm/move'" in err
    assert type_in("service", "list", "--backend", "zenoh", "--json") == (0, "[]\n", "")
    code, _out, err = type_in("service", "list", "--backend", "zenho")
    assert code == 1
    assert "zenho" in err
