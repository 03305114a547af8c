"""Tests of the command `nep` as a process: exit codes, both output streams and signals."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import nep
from tests.nep.programs import GREETINGS_S

REPOSITORY = Path(__file__).resolve().parents[3]
LONG_S = 60


def environment():
    return {**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONUNBUFFERED": "1", "COLUMNS": "120"}


PATIENT = f"""
import sys
import nep.backends.base
nep.backends.base.HANDSHAKE_TIMEOUT_S = {GREETINGS_S}
sys.argv[0] = "nep"
from nep.cli import main
main()
"""


def run(*arguments, given=""):
    """Run a command, which waits long for handshakes."""
    return subprocess.run(
        [sys.executable, "-c", PATIENT, *arguments],
        input=given,
        capture_output=True,
        encoding="utf-8",
        timeout=LONG_S,
        env=environment(),
        check=False,
    )


class Running:
    """Running command with pipes for its output."""

    def __init__(self, *arguments):
        own_group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if sys.platform == "win32" else {}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "nep", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            env=environment(),
            **own_group,
        )

    def wait_says(self, word):
        """Return the next line of the error stream that contains `word`."""
        for line in self.process.stderr:
            if word in line:
                return line
        raise AssertionError(f"it ended with {self.process.wait(LONG_S)} and never said '{word}'")

    def interrupt(self):
        """Press Ctrl+C; return the exit code and the remaining output of both streams."""
        self.process.send_signal(signal.CTRL_BREAK_EVENT if sys.platform == "win32" else signal.SIGINT)
        out, err = self.process.communicate(timeout=LONG_S)
        return self.process.returncode, out, err

    def close(self):
        self.process.kill()
        self.process.wait(LONG_S)
        for pipe in (self.process.stdout, self.process.stderr):
            pipe.close()


@pytest.fixture
def start():
    running = []

    def make(*arguments):
        running.append(Running(*arguments))
        return running[-1]

    yield make
    for each in running:
        each.close()


@pytest.fixture
def address(monkeypatch):
    """Free address for a master that is not started yet."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        chosen = f"127.0.0.1:{probe.getsockname()[1]}"
    monkeypatch.setenv("NEP_MASTER", chosen)
    return chosen


@pytest.fixture
def running_master(address):
    with nep.Master(address, learn_s=0.0) as master:
        yield master


def test_help_lists_commands_and_subcommands(type_in):
    shown = type_in("--help").stdout
    assert all(word in shown for word in ("master", "node", "topic"))
    shown = type_in("topic", "--help").stdout
    assert all(word in shown for word in ("list", "echo", "pub"))


def test_version_option_prints_the_package_version():
    assert run("--version").stdout == f"nep {nep.__version__}\n"
    told = re.search(r'^__version__ = "(.+)"$', (REPOSITORY / "nep" / "version.py").read_text(), re.MULTILINE)
    assert told is not None
    assert nep.__version__ == told[1]


def test_master_option_is_accepted_before_and_after_the_command(running_master, monkeypatch, type_in):
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")
    for words in (
        ("--master", running_master.address, "topic", "list"),
        ("topic", "list", "--master", running_master.address),
    ):
        assert type_in(*words).returncode == 0
    assert type_in("master", "--master", running_master.address).stderr.startswith(
        "nep: a master is already running at"
    )


def test_type_in_restores_the_environment_after_a_command(type_in):
    before = dict(os.environ)
    assert type_in("--master", "nosuchhost.invalid:7781", "topic", "list").returncode == 1
    assert dict(os.environ) == before


def test_unknown_host_name_is_reported(type_in):
    done = type_in("--master", "nosuchhost.invalid:7781", "topic", "list")
    assert done.returncode == 1
    assert done.stderr.startswith("nep: unknown computer 'nosuchhost.invalid'; ")
    doctor = type_in("doctor", "--master", "nosuchhost.invalid:7781")
    assert "Can't find a computer named “nosuchhost.invalid”" in doctor.stdout
    assert "Start a master" not in doctor.stdout
    assert type_in("--master", "not an address", "topic", "list").stderr.startswith(
        "nep: 'not an address:7780' isn't a valid address of a master"
    )


def test_mismatching_message_type_is_warned_about(running_master, type_in):
    with nep.node("talker") as node:
        node.new_pub("/odom")
        done = type_in("topic", "pub", "/odom", "text", "--type", "string")
        assert done.returncode == 0
        assert "'/odom' is published with the type 'json', not 'string'" in done.stderr
    assert "did you mean 'string'?" in type_in("topic", "pub", "new", "1", "--type", "strng").stderr


def test_non_utf_8_input_is_rejected_with_its_position(running_master):
    done = subprocess.run(
        [sys.executable, "-m", "nep", "topic", "pub", "t", "-"],
        input=b'{"n": 1}\n\xff\xfe\n',
        capture_output=True,
        timeout=LONG_S,
        env=environment(),
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.startswith(b"nep: byte 1 of line 2 isn't valid UTF-8; ")


def test_unknown_command_exits_with_code_2():
    done = run("topic", "frobnicate")
    assert done.returncode == 2
    assert "frobnicate" in done.stderr
    assert "Traceback" not in done.stderr


def test_missing_master_is_reported_with_the_start_command(address, type_in):
    for command in (("node", "list"), ("topic", "list"), ("topic", "echo", "t"), ("topic", "pub", "t", "1")):
        done = type_in(*command)
        assert done.returncode == 1
        assert (
            done.stderr
            == f"nep: no master replied at '{address}' (waited 2 s); start one with 'nep master'\n"
        )
        assert not done.stdout


def test_lists_are_tables_or_json(running_master, type_in):
    with nep.node("Pepper") as node, nep.node("page") as other:
        pub = node.new_pub("/Pepper/battery")
        with other.new_sub("/Pepper/battery"):
            shown = type_in("topic", "list").stdout
            topics = json.loads(type_in("topic", "list", "--json").stdout)
            nodes = json.loads(type_in("node", "list", "--json").stdout)
            assert "Pepper" in type_in("node", "list").stdout
        assert pub.topic in shown
        assert [topic["name"] for topic in topics] == ["/Pepper/battery"]
        assert topics[0]["publishers"][0]["id"] == str(pub.id), "readers with floats alone would lose digits"
        assert {(each["name"], *each["publishes"], *each["subscribes"]) for each in nodes} == {
            ("Pepper", "/Pepper/battery"),
            ("page", "/Pepper/battery"),
        }


def test_empty_lists_show_a_message_and_empty_json(running_master, type_in):
    assert "no topics" in type_in("topic", "list").stderr
    assert "no nodes" in type_in("node", "list").stderr
    assert json.loads(type_in("topic", "list", "--json").stdout) == []


@pytest.mark.usefixtures("patient")
def test_topic_pub_delivers_the_message(running_master, type_in):
    with nep.node("listener") as node, node.new_sub("t") as sub:
        done = run("topic", "pub", "t", '{"message": "Grüße"}')
        assert done.returncode == 0
        assert "to 1 subscriber" in done.stderr
        assert sub.listen(timeout_s=LONG_S) == (True, {"message": "Grüße"})
        run("topic", "pub", "t", "-", given='{"n": 1}\n{"n": 2}\n')
        assert [sub.listen(timeout_s=LONG_S)[1]["n"] for _ in range(2)] == [1, 2]
        type_in("topic", "pub", "t", "7", "--rate", "200", "--count", "5")
        assert [sub.listen(timeout_s=LONG_S)[1] for _ in range(5)] == [7] * 5


@pytest.mark.usefixtures("patient")
def test_topic_pub_uses_the_type_of_the_topic(running_master, type_in):
    with nep.node("listener") as node, node.new_sub("words", "string") as sub:
        assert type_in("topic", "pub", "words", "no JSON at all").returncode == 0
        assert sub.listen(timeout_s=LONG_S) == (True, "no JSON at all")


def test_invalid_payload_or_topic_exits_with_code_1_and_invalid_rate_with_code_2(running_master, type_in):
    done = type_in("topic", "pub", "t", "no JSON at all")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("nep: 'no JSON at all' isn't valid JSON; ")
    assert type_in("topic", "pub", "bad topic", "1").returncode == 1
    assert "'bad topic'" in type_in("topic", "pub", "bad topic", "1").stderr
    assert type_in("topic", "pub", "t", "1", "--rate", "0").returncode == 2


@pytest.mark.usefixtures("patient")
def test_echo_writes_one_json_object_per_line(running_master, type_in):
    with nep.node("talker") as node:
        node.new_pub("t", latched=True).publish({"n": 1})
        record = json.loads(run("topic", "echo", "t", "--count", "1", "--json").stdout)
        assert (record["topic"], record["seq"], record["payload"]) == ("t", 1, {"n": 1})
        assert '{"n":1}' in type_in("topic", "echo", "t", "-n", "1").stdout


def test_echo_exits_when_its_timeout_expires(running_master, type_in):
    done = type_in("topic", "echo", "t", "--timeout", "0.2")
    assert done.returncode == 1
    assert "timed out after 0.2 s while waiting for a message on 't'" in done.stderr


def test_ctrl_c_ends_echo_and_latched_publishing_with_130_and_no_traceback(running_master, start):
    with nep.node("talker") as node:
        pub = node.new_pub("t")
        echo = start("topic", "echo", "t", "--json")
        for _ in iter(lambda: pub.subscribers, 1):
            threading.Event().wait(0.02)
        pub.publish({"n": 1})
        assert json.loads(echo.process.stdout.readline())["payload"] == {"n": 1}
        latched = start("topic", "pub", "late", "1", "--latched")
        latched.wait_says("Ctrl+C")
        for each in (echo, latched):
            code, out, err = each.interrupt()
            assert (code, out) == (130, "")
            assert "Traceback" not in err
            assert "bort" not in err


def test_latched_message_reaches_a_late_subscriber(running_master, start):
    start("topic", "pub", "late", '{"n": 1}', "--latched").wait_says("Ctrl+C")
    with nep.node("listener") as node, node.new_sub("late") as sub:
        assert sub.listen(timeout_s=LONG_S) == (True, {"n": 1})


def test_closed_output_pipe_ends_echo_with_exit_code_1_without_traceback(running_master, start):
    with nep.node("talker") as node:
        pub = node.new_pub("t")
        echo = start("topic", "echo", "t", "--json")
        for _ in iter(lambda: pub.subscribers, 1):
            threading.Event().wait(0.02)
        echo.process.stdout.close()
        for _ in iter(echo.process.poll, 1):
            pub.publish({"n": 1})
            threading.Event().wait(0.02)
        assert "Traceback" not in echo.process.stderr.read()


def test_master_runs_until_ctrl_c_and_a_second_one_fails(address, start):
    port = address.rpartition(":")[2]
    first = start("master", "--port", port, "--no-gateway")
    assert address in first.wait_says("master at")
    assert nep.is_running(address, LONG_S)
    second = run("master", "--no-gateway")
    assert second.returncode == 1
    assert "already running" in second.stderr
    code, _, err = first.interrupt()
    assert code == 130
    assert "Traceback" not in err
    assert not nep.is_running(address, 0.3)


def test_master_exits_when_its_owner_has_ended_and_no_node_remains(address, start):
    owner = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    master = start("master", "--no-gateway", "--owner-pid", str(owner.pid))
    master.wait_says("master at")
    with nep.node("foreign") as node, node.new_sub("t"):
        owner.communicate(b"\n")
        with pytest.raises(subprocess.TimeoutExpired):
            master.process.wait(1.0)
    assert master.process.wait(LONG_S) == 0


def test_master_at_a_network_address_without_the_listen_option_is_rejected_with_advice(monkeypatch, type_in):
    monkeypatch.setenv("NEP_MASTER", "192.168.1.7:7780")
    done = type_in("master", "--no-gateway")
    assert done.returncode == 1
    assert "add --listen 192.168.1.7" in done.stderr


@pytest.mark.skipif(sys.platform == "darwin", reason="macOS answers at one loopback address only")
def test_master_with_listen_option_prints_its_address_for_other_computers_and_warns(address, start, type_in):
    port = address.rpartition(":")[2]
    master = start("master", "--port", port, "--no-gateway", "--listen", "127.0.0.2")
    assert address in master.wait_says("master at")
    assert nep.is_running(f"127.0.0.2:{port}", LONG_S)
    assert f"NEP_MASTER=127.0.0.2:{port}" in master.wait_says("other computers connect with")
    assert master.wait_says("no password")
    master.interrupt()
    refused = type_in("master", "--port", port, "--no-gateway", "--listen", "203.0.113.77")
    assert refused.returncode == 1
    assert "'203.0.113.77' isn't an address of this computer" in refused.stderr


def test_command_starts_without_importing_rich():
    code = "import sys, nep.cli.app; sys.exit(any(name.split('.')[0] == 'rich' for name in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], env=environment(), check=False).returncode == 0


def test_command_line_imports_only_its_own_command():
    code = (
        "import sys\n"
        "from nep.cli.app import run\n"
        "sys.argv = ['nep', 'doctor', '--timeout', 'x']\n"
        "assert run() == 2\n"
        "assert 'nep.cli.programs.doctor' in sys.modules\n"
        "others = ('programs.masters', 'topics', 'recordings', 'programs.watch', 'programs.bridge')\n"
        "assert not [name for name in others if f'nep.cli.{name}' in sys.modules]\n"
    )
    assert subprocess.run([sys.executable, "-c", code], env=environment(), check=False).returncode == 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("topic", "echo", "t", "--timeout", "nan"), "nan isn't a valid duration"),
        (("topic", "hz", "t", "--timeout", "-1"), "-1 isn't a valid duration"),
        (("topic", "pub", "t", "1", "--type", "a\x01"), "it is 'a\\x01'; use at most 200 characters"),
        (("topic", "pub", "t", "1", "--type", "a" * 300), "(300 characters)'; use at most 200 characters"),
    ],
)
def test_invalid_arguments_are_rejected_before_connecting_to_a_master(words, sentence, type_in):
    done = type_in(*words)
    assert done.returncode == 2
    assert sentence in " ".join(done.stderr.replace("│", " ").split())
