"""Tests of the findings about a topic that is not received, from constructed facts and a real master."""

from __future__ import annotations

import json
import socket
import time
from dataclasses import replace
from unittest.mock import Mock

import pytest
import typer

import nep
from nep.cli.programs.doctor import doctor
from nep.programs.doctor import TopicFacts, closest_topic, collect_topic, diagnose, topic_findings
from nep.programs.doctor.facts import PublisherFact
from nep.programs.doctor.listen import probe_endpoint
from nep.protocol.graph_view import Alert

NOW = 1_800_000_000.0
CAMERA = PublisherFact("camera_driver", "lab", sent=18_204, last_message_s=NOW - 4)
MISSED = TopicFacts(
    "/robot/camera", NOW, "192.168.1.20:7780", is_shared=True, publishers=(CAMERA,),
    other_topics={"/robot/camera": 30.0, "/robot/depth": 60.0, "/once": None}, listen_duration_s=1.5,
)  # fmt: skip


def found(**changes):
    """Return the findings about a silent camera with these changes, by id."""
    return {each.id: each for each in topic_findings(replace(MISSED, **changes))}


def publisher(**changes):
    return {"publishers": (replace(CAMERA, **changes),)}


def test_silent_publisher_is_reported_with_its_duration_and_alternatives():
    (one,) = found().values()
    at = time.strftime("%H:%M:%S", time.localtime(NOW - 4))
    assert (one.id, one.severity, one.instead) == ("topic:silent:camera_driver", "error", "")
    assert one.sentence == "“camera_driver” is connected but has sent nothing on /robot/camera for 4 s."
    assert one.fix.startswith(f"Its last message was number 18204, at {at}.")
    (one,) = found(**publisher(remedies=("restart_camera",))).values()
    assert one.instead == "restart_camera"
    assert one.fix.endswith("Call its service “restart_camera” to restart it.")
    (one,) = found(**publisher(sent=0, last_message_s=None)).values()
    assert one.sentence == "“camera_driver” is connected but has sent nothing on /robot/camera yet."
    (one,) = found(**publisher(sent=None, generation="B")).values()  # its messages are not counted
    assert "number" not in one.fix
    assert at in one.fix


def test_unpublished_topic_is_reported_with_the_intended_name():
    one = found(topic="/robot/deph", publishers=())["topic:near"]
    assert one.sentence == "/robot/deph has no publisher."
    assert one.fix == "Did you mean /robot/depth? Its publishers send 60 messages per second."
    assert one.instead == "/robot/depth"
    assert found(topic="/onc", publishers=())["topic:near"].fix == "Did you mean /once?"


@pytest.mark.parametrize(
    ("missed", "meant"),
    [
        ("camera", "/camera"),
        ("/Camera", "/camera"),
        ("/depth", "/robot/depth"),
        ("/robot/dpeth", "/robot/depth"),
        ("/speech", None),
        ("/", None),
    ],
)
def test_intended_topic_name_is_found(missed, meant):
    assert closest_topic(missed, ["/camera", "/robot/depth"]) == meant


def test_closest_topic_is_another_existing_topic_or_none():
    assert closest_topic("/pose", ["/left/pose", "/right/pose"]) in {"/left/pose", "/right/pose", None}
    assert closest_topic("/pose", []) is None
    assert closest_topic("/pose", ["/pose"]) is None


def test_missing_publisher_is_reported_with_the_published_topics():
    nobody = found(topic="/speech", publishers=(), is_shared=False, address="127.0.0.1:7780")
    assert nobody["topic:nobody"].fix.endswith("Topics published now: /once, /robot/camera and /robot/depth.")
    assert nobody["topic:closed"].severity == "info"
    many = {f"/t{number}": None for number in range(40)} | {"/nep/log": None}
    assert found(topic="/x", publishers=(), other_topics=many)["topic:nobody"].fix.endswith(
        "/t12 and 35 more."
    )
    alone = found(topic="/speech", publishers=(), other_topics={})
    assert (
        alone["topic:nobody"].fix
        == "Start the program that publishes it. No other topics are published either."
    )
    assert "topic:closed" not in alone  # the master accepts other computers
    assert alone["topic:shared"].severity == "info"
    assert "firewall" in alone["topic:shared"].fix
    assert "topic:shared" not in nobody
    service = found(topic="/restart", publishers=(), services=("/restart",))["topic:service"]
    assert service.instead == "/restart"


@pytest.mark.parametrize(
    ("reach", "sentence", "fix"),
    [
        ("elsewhere", "“camera_driver” can be reached only from its own computer, lab.", "NEP_MASTER"),
        (
            "timeout",
            "“camera_driver” publishes at 10.0.0.7:41000 (lab), but that address doesn't respond.",
            "firewall",
        ),
        (
            "refused",
            "“camera_driver” published at 10.0.0.7:41000 (lab), but nothing is listening there now.",
            "Start it again",
        ),
        (
            "unknown",
            (
                "“camera_driver” publishes at 10.0.0.7:41000 (lab), but this computer has no route to that "
                "address."
            ),
            "network",
        ),
    ],
)
def test_unreachable_publisher_address_is_reported(reach, sentence, fix):
    (one,) = found(**publisher(endpoint="tcp://10.0.0.7:41000", reach_failure=reach)).values()
    assert (one.id, one.severity, one.sentence) == ("topic:address:camera_driver", "error", sentence)
    assert fix in one.fix


def test_incompatible_versions_are_reported():
    (one,) = found(**publisher(generation="0.5.4.6")).values()
    assert (one.id, one.command) == ("topic:version:camera_driver", "pip install nep==0.5.4.8")
    (wire,) = found(rejected=12, **publisher(last_message_s=NOW)).values()
    assert (
        wire.sentence == "Messages on /robot/camera come from a version of NEP that this version can't read."
    )
    assert "camera_driver (lab)" in wire.fix


def test_readable_unreadable_and_blocked_messages_are_reported():
    assert [each.severity for each in found(received=1, **publisher(last_message_s=NOW)).values()] == ["ok"]
    bad = found(received=1, decode_problem="it is not valid JSON", **publisher(last_message_s=NOW))[
        "topic:unreadable"
    ]
    assert bad.sentence == "Messages on /robot/camera arrive but can't be read: it is not valid JSON."
    blocked = found(**publisher(last_message_s=NOW))["topic:blocked"]
    assert blocked.sentence.startswith(
        "/robot/camera is published by camera_driver (lab), but no messages were received"
    )


def test_alert_of_the_master_about_the_topic_is_an_error():
    alert = Alert("type:/robot/camera", "The topic “/robot/camera” has 2 types", "Use the same type.")
    one = found(received=1, alerts=(alert,))["type:/robot/camera"]
    assert (one.severity, one.sentence[-1], one.fix) == ("error", ".", "Use the same type.")


def test_invalid_topic_name_is_reported(master):
    for name in ("two words", "", "x" * 300, "a{b"):
        (one,) = topic_findings(collect_topic(name, master.address))
        assert (one.id, one.severity) == ("topic:name", "error")


def test_endpoint_reachability_is_checked(monkeypatch):
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        place = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        assert probe_endpoint(place) == "refused"  # bound, but not listening
        server.listen(1)
        assert probe_endpoint(place) == ""
    assert probe_endpoint("ipc://@nep-7780") == ""  # not a network endpoint

    for error, reach in ((TimeoutError(), "timeout"), (OSError("no route to host"), "unknown")):
        monkeypatch.setattr(socket, "create_connection", Mock(side_effect=error))
        assert probe_endpoint("tcp://10.255.255.1:80") == reach


def test_published_topics_of_a_running_master_are_diagnosed(master):
    with nep.node("arm", master=master.address) as node:
        node.new_pub("/arm/pose").publish({"x": 1})
        numbers = node.new_pub("/arm/raw")
        with nep.node("ear", master=master.address) as other:
            ear = other.new_sub("/arm/raw")
            numbers.publish({"x": 2})
            assert ear.receive(30.0) is not None
        facts = collect_topic("/arm/pose", master.address)
        assert facts is not None
        (one,) = facts.publishers
        assert (one.node, one.reach_failure) == ("arm", "")
        assert one.endpoint.startswith("tcp://127.0.0.1:")
        (silent,) = [each for each in topic_findings(facts) if each.severity == "error"]
        assert silent.id in {"topic:silent:arm", "topic:blocked"}  # depends on the age of the master's data
        near = diagnose(master.address, "/arm/posse")
        assert (near[0].id, near[0].instead) == ("topic:near", "/arm/pose")
        assert "master" in {each.id for each in near}


def test_undecodable_topic_is_reported(master):
    with nep.node("arm", master=master.address) as node:
        node.new_pub("/pose", latched=True).publish_bytes(b"{no json")
        facts = collect_topic("/pose", master.address)
    assert facts is not None
    (one,) = [each for each in topic_findings(facts) if each.id == "topic:unreadable"]
    assert (facts.received, one.severity) == (1, "error")
    assert "arm (" in one.fix


def test_topic_is_not_diagnosed_without_a_master():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    assert collect_topic("/camera", address) is None
    told = {each.id for each in diagnose(address, "/camera")}
    assert "master:none" in told
    assert not any(id.startswith("topic") for id in told)


def test_command_accepts_a_topic(master, capsys):
    with pytest.raises(typer.Exit) as ended:
        doctor(master.address, as_json=True, topic="/no/such")
    told = json.loads(capsys.readouterr().out)
    assert ended.value.exit_code == 2
    assert told[0]["id"] == "topic:nobody"
    assert {"id", "severity", "sentence", "fix", "command", "instead"} == set(told[0])
