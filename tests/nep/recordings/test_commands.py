"""Tests of `nep record`, `nep play` and `nep recording`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer

import nep
from nep.cli.app import app
from nep.cli.recordings.recording_files import parse_time_ns
from nep.cli.recordings.ring import has_flight_recorder
from nep.errors import NepError, RecordingError, RecordingsUnavailableError, ServiceError
from nep.recordings.reader import Recording
from tests.nep.programs import eventually
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import json_message, picture, record


def run(*words: object) -> None:
    app([str(each) for each in words], standalone_mode=False)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "Tour.mcap"
    messages = [json_message(seq, topic="/arm/joints", size=20) for seq in range(1, 21)]
    command = nep.Message("/pepper/command", b'{"op":"invoke"}', "json", "robot/command", seq=1, publisher=4)
    rize = nep.Message("robot_action", b'{"action":"wave"}', "json", "json", seq=1, publisher=5)
    own = b'{"rb:topics":{"command":"/own/orders","world":7}}'
    described = nep.Message("/own/description", own, "json", "robot/description", seq=1, publisher=6)
    record(path, [[*messages, picture(1), command, rize, described]])
    return path


@pytest.mark.skipif(os.name == "nt", reason="Ctrl+C of another program needs POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_record_command_writes_a_complete_private_file_when_interrupted(master, tmp_path, name):
    path = tmp_path / "a.mcap"
    command = [
        "-m",
        "nep",
        "record",
        "/arm/*",
        "-o",
        str(path),
        "--note",
        "first",
        "--master",
        master.address,
    ]
    child = subprocess.Popen(
        [sys.executable, *command], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    with child, nep.node("robot", master=master.address) as robot:
        publisher = robot.new_pub("/arm/joints")
        eventually(lambda: publisher.subscribers == 1, 60.0)
        assert "press Ctrl+C to stop" in child.stderr.readline()
        for n in range(50):
            publisher.publish({"n": n})
        eventually(
            lambda: [each.received for each in robot.graph().patterns["/arm/*"].subscribers] == [50], 60.0
        )
        eventually(lambda: path.exists() and path.stat().st_size > 500)
        child.send_signal(getattr(signal, name))
        _out, err = child.communicate(timeout=60)
    assert (child.returncode, "50 messages of 1 topic in" in err) == (0, True), err
    assert McapDoctor(path).problems == []
    assert path.stat().st_mode & 0o777 == 0o600
    with Recording(path) as recording:
        assert [each.message.payload["n"] for each in recording.read()] == list(range(50))
        assert recording.recorder_metadata["note"] == "first"


def test_record_command_stops_after_its_duration_and_prints_json(master, tmp_path, capfdbinary):
    path = tmp_path / "a.mcap"
    run("record", "-o", path, "--duration", 0.2, "--not", "/log", "--json", "--master", master.address)
    told = json.loads(capfdbinary.readouterr().out)
    assert (told["path"], told["problem"]) == (str(path), "")
    with pytest.raises(RecordingError, match=r"a\.mcap': .*already exists"):
        run("record", "-o", path, "--duration", 0.2, "--master", master.address)
    with pytest.raises(typer.BadParameter):
        run("record", "-o", tmp_path / "b.mcap", "--duration", 0, "--master", master.address)
    assert not (tmp_path / "b.mcap").exists()


@pytest.mark.skipif(os.name == "nt", reason="signals to another program need POSIX")
def test_ring_command_saves_the_last_seconds_on_command_and_on_signal(master, tmp_path, capfdbinary):
    command = ["-m", "nep", "recording", "ring", "/arm/*", "--not", "/arm/raw", "-o", str(tmp_path)]
    child = subprocess.Popen(
        [sys.executable, *command, "--master", master.address],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )

    def files() -> list[Path]:
        return sorted(each for each in tmp_path.glob("kept-*.mcap"))

    with child, nep.node("robot", master=master.address) as robot:
        publishers = [robot.new_pub(topic) for topic in ("/arm/joints", "/arm/raw", "/leg")]
        assert "buffering the last 60 s" in child.stderr.readline()
        eventually(lambda: publishers[0].subscribers == 1, 60.0)
        for publisher in publishers:
            publisher.publish({"n": 1})
        words = ("recording", "keep", "--master", master.address)

        def is_kept() -> bool:
            with suppress(ServiceError):  # the message hasn't arrived yet
                run(*words, "--note", "it fell", "--json")
            return bool(files())

        eventually(is_kept, 60.0)
        told = json.loads(capfdbinary.readouterr().out)
        assert [str(each) for each in files()] == [told["path"]]
        child.send_signal(signal.SIGUSR1)
        eventually(lambda: len(files()) == 2, 60.0)
        with pytest.raises(NepError, match="isn't a valid duration"):
            run(*words, "--seconds", "-1")
        with pytest.raises(NepError, match="a JSON object"), nep.node("any", master=master.address) as node:
            node.new_client("flight_recorder/keep", timeout_s=60.0).call({"seconds": "x"})
        child.send_signal(signal.SIGTERM)
        child.communicate(timeout=60)
        eventually(lambda: not has_flight_recorder(robot.graph()))
        with pytest.raises(NepError, match="'nep recording ring' isn't running"):
            run(*words)
    assert child.returncode == 0
    assert sorted(each.name for each in tmp_path.iterdir()) == [each.name for each in files()]
    with Recording(told["path"]) as recording:
        assert list(recording.topics) == ["/arm/joints"]
        assert recording.recorder_metadata["note"] == "it fell"
        assert recording.message_count == told["message_count"] > 0
    for wrong in (("--seconds", 0), ("--seconds", "nan"), ("--size", -1)):
        with pytest.raises(typer.BadParameter):
            run("recording", "ring", "-o", tmp_path, "--master", master.address, *wrong)


def test_info_command_lists_topics_and_reports_an_incomplete_file(path, tmp_path, capfd):
    run("recording", "info", path)
    out = capfd.readouterr().out
    assert "24 messages in 0:00" in out
    line = next(line for line in out.splitlines() if line.startswith("/arm/joints"))
    assert line.split()[:5] == ["/arm/joints", "json", "json", "jsonschema", "20"]
    run("recording", "info", path, "--json")
    told = json.loads(capfd.readouterr().out)
    assert told["topics"]["/arm/joints"]["figures"]["received"] == 20
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-200])
    run("recording", "info", cut)
    assert "nep recording repair" in capfd.readouterr().err


def test_repair_command_reports_recovered_messages(path, tmp_path, capfd):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-200])
    run("recording", "repair", cut)
    assert "recovered and verified 24 messages, 0:00" in capfd.readouterr().err
    run("recording", "repair", cut, "-o", tmp_path / "b.mcap", "--json")
    assert json.loads(capfd.readouterr().out)["recovered"] == 24


def test_export_command_writes_to_the_output_folder_and_rejects_invalid_options(path, tmp_path, capfd):
    run("recording", "export", path, "/arm/*", "-o", tmp_path / "out")
    assert "20 messages" in capfd.readouterr().err
    assert [each.name for each in (tmp_path / "out").iterdir()] == ["arm_joints.csv"]
    run("recording", "export", path, "-f", "pictures", "-o", tmp_path / "out", "--json")
    assert json.loads(capfd.readouterr().out)[0]["count"] == 1
    for wrong in (("-f", "xls"), ("/none",), ("/no*ne",), ("--from", "-1"), ("--from", "2", "--to", "1")):
        with pytest.raises(typer.BadParameter):
            run("recording", "export", path, "-o", tmp_path / "out", *wrong)


@pytest.mark.usefixtures("patient")
def test_play_command_publishes_only_the_named_topics(path, master, capfd):
    with nep.node("hears", master=master.address) as node:
        heard: list[nep.Message] = []
        node.new_sub("**", sink=heard.extend)
        words = ("play", path, "--master", master.address, "--speed", 10)
        run(*words, "/arm/joints", "--remap", "/arm/joints=/test/joints")
        eventually(lambda: len(heard) >= 20)
        assert {(each.topic, each.msg_type) for each in heard} == {("/test/joints", "json")}
        assert [bytes(each.data) for each in heard] == [
            bytes(json_message(seq, size=20).data) for seq in range(1, 21)
        ]
        assert "published 20 messages" in capfd.readouterr().err
        heard.clear()
        run(*words, "--all")
        assert "not published: '/pepper/command' moves a robot" in capfd.readouterr().err
        eventually(lambda: len(heard) >= 22)
        assert {each.topic for each in heard} == {"/arm/joints", "/camera", "/own/description"}
        assert next(each for each in heard if each.topic == "/camera").payload.shape == (12, 16, 3)
        heard.clear()
        run(*words, "/pepper/command", "robot_action", "--arm")
        eventually(lambda: len(heard) >= 2)
        assert {each.topic for each in heard} == {"/pepper/command", "robot_action"}
        heard.clear()
        run(*words, "/arm/joints", "--from", "0.05", "--to", "0.1")
        eventually(lambda: len(heard) >= 4)
        assert 4 <= len(heard) <= 7


@pytest.mark.parametrize(
    ("words", "error", "said"),
    [
        ((), typer.BadParameter, "specify the topics"),
        (("/arm/joint",), typer.BadParameter, "did you mean '/arm/joints'"),
        (("/pepper/command",), typer.BadParameter, "then add --allow-moving /pepper/command"),
        (("/*/command",), typer.BadParameter, "then add --allow-moving /pepper/command"),
        (("robot_action",), typer.BadParameter, "moves own; .*then add --allow-moving own"),
        (("--all", "--speed", "0"), typer.BadParameter, "^0 .*0\\.1 to 10"),
        (("/arm/joints", "--remap", "/x=/y"), typer.BadParameter, "--remap OLD=NEW"),
        (("/arm/joints", "--from", "5"), typer.BadParameter, "within the recording"),
        (("/arm/joints", "--remap", "/arm/joints=robot_action"), typer.BadParameter, "moves own"),
        (
            ("/arm/joints", "--remap", "/arm/joints=/Fido/command"),
            typer.BadParameter,
            "'/Fido/command' moves a robot; .*then add --allow-moving /Fido/command",
        ),
        (
            ("/arm/joints", "--remap", "/arm/joints=/own/orders"),
            typer.BadParameter,
            "'/own/orders' moves own",
        ),
        (
            ("/arm/joints", "--remap", "/arm/joints=/cmd_vel"),
            typer.BadParameter,
            "'/cmd_vel' moves a robot; .*then add --allow-moving /cmd_vel",
        ),
        (("/arm/joints", "--remap", "/arm/joints=two words"), NepError, "two words"),
    ],
)
def test_play_command_rejects_invalid_options_and_robot_topics_without_permission(path, words, error, said):
    with pytest.raises(error, match=said):
        run("play", path, *words)


def describe(robot: nep.Node, name: str, command: str) -> list[nep.Message]:
    """Publish a robot's description with a command topic; return the list that receives its messages."""
    description = {"title": name, "rb:topics": {"command": command}}
    robot.new_pub(f"/{name}/description", "robot/description", latched=True).publish(description)
    told: list[nep.Message] = []
    robot.new_sub(command, sink=told.extend)
    return told


@pytest.mark.usefixtures("patient")
def test_play_command_does_not_move_a_connected_robot_without_permission(
    master, tmp_path, capfd, monkeypatch
):
    monkeypatch.setattr("nep.cli.recordings.play._ROBOT_DISCOVERY_S", 60.0)
    path = tmp_path / "Drive.mcap"
    record(path, [[json_message(1, topic="/Rover/drive"), json_message(2, topic="/weather")]])
    words = ("play", path, "--master", master.address, "--speed", 10)
    with nep.node("rover", master=master.address) as robot:
        told = describe(robot, "Rover", "/Rover/drive")
        run(*words, "--all")
        assert "--allow-moving Rover" in capfd.readouterr().err
        for named in (("/Rover/drive",), ("/weather", "--remap", "/weather=/Rover/drive"), ("/**",)):
            with pytest.raises(typer.BadParameter, match=r"'/Rover/drive' moves Rover; .*-moving Rover"):
                run(*words, *named)
        with pytest.raises(typer.BadParameter):
            run(*words, "/Rover/drive", "--allow-moving", "Fido")
        assert not told
        run(*words, "--all", "--allow-moving", "Rover")
        eventually(lambda: told)
        run(*words, "/Rover/drive", "--arm")
        eventually(lambda: len(told) == 2)


@pytest.mark.usefixtures("patient")
def test_play_command_stops_publishing_a_topic_when_a_robot_moved_by_the_topic_connects(
    master, tmp_path, capfd
):
    path = tmp_path / "Drive.mcap"
    record(path, [[json_message(seq, topic="/drive") for seq in range(1, 601)]])
    told = []
    with nep.node("rover", master=master.address) as robot, nep.node("hears", master=master.address) as node:

        def come(_messages: object) -> None:
            if not told:
                told.append(describe(robot, "Rover", "/drive"))

        node.new_sub("/drive", sink=come)
        words = ["play", str(path), "/drive", "--master", master.address, "--speed", "10"]
        assert app(words, standalone_mode=False) == 1
    assert "not published: '/drive' moves Rover" in capfd.readouterr().err
    assert len(told[0]) < 300


def test_shell_completion_offers_the_topics_of_the_recording(path):
    from nep.cli.recordings.recording_files import _complete_recorded_topic

    def offered(file):
        return _complete_recorded_topic(SimpleNamespace(params={"file": file}), "/a")

    assert offered(path) == ["/arm/joints"]
    assert offered(path.parent / "none") == offered(None) == []


def test_recording_modules_are_imported_lazily_and_a_missing_package_is_reported():
    code = (
        "import sys, nep.cli.app\n"
        "heavy = ('nep.recordings', 'mcap', 'zstandard', 'lz4', 'pyarrow', 'rich.progress')\n"
        "assert not [each for each in sys.modules if each.startswith(heavy)]\n"
        "sys.modules['zstandard'] = None\n"
        "sys.argv = ['nep', 'recording', 'info', 'a.mcap']\n"
        "sys.exit(nep.cli.app.run())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 1
    assert done.stderr == (
        "nep: recordings need packages that aren't installed; pip install 'nep-studio[recordings]'\n"
    )
    assert issubclass(RecordingsUnavailableError, NepError)


START = 1_795_000_000 * 10**9
HOUR = 3600 * 10**9


@pytest.mark.parametrize(
    ("text", "after_s"),
    [
        ("0", 0.0),
        (" 12.5 ", 12.5),
        ("{clock}", 90.0),
        ("{clock}.250", 90.25),
        ("{day}T{clock}", 90.0),
        ("{day} {clock}", 90.0),
        ("{utc}Z", 90.0),
        ("{utc}+00:00", 90.0),
    ],
)
def test_start_time_is_parsed_from_seconds_or_clock_time(text, after_s):
    utc = datetime.fromtimestamp(START / 1e9 + 90, timezone.utc)
    at = utc.astimezone()
    given = text.format(clock=f"{at:%H:%M:%S}", day=f"{at:%Y-%m-%d}", utc=f"{utc:%H:%M:%S}")
    assert parse_time_ns(given, START, START + HOUR) == START + round(after_s * 1e9)


def test_clock_time_after_midnight_is_on_the_next_day():
    at = datetime.fromtimestamp(START / 1e9, timezone.utc).astimezone()
    midnight = at.replace(hour=23, minute=59, second=50, microsecond=0)
    start = int(midnight.timestamp()) * 10**9
    assert parse_time_ns("00:00:05", start, start + 60 * 10**9) == start + 15 * 10**9
    assert parse_time_ns("00:00:05", start, start + 10**9) < start  # the recording ends before that time


@pytest.mark.parametrize(
    "text",
    [
        "",
        "noon",
        "25:00:00",
        "-1",
        "1e9",
        "nan",
        "inf",
        "2026-13-01T00:00:00",
        "1" * 400,
    ],
)
def test_malformed_start_time_or_time_outside_the_recording_is_rejected(text):
    with pytest.raises(typer.BadParameter, match="isn't a valid"):
        parse_time_ns(text, START, START + HOUR)
