"""Tests of the standard streams of commands: code pages, full disks and closed pipes."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import nep
from nep.cli.screen import print_error_message, print_status, show_alerts
from nep.protocol.graph_view import Alert
from nep.system.streams import command_line_arguments

REPOSITORY = Path(__file__).resolve().parents[3]
LONG_S = 140
NASTY = "😀 \u2013 “two” → \x1b[2J \x9b2J \u202e Grüße 日本"
TOPIC = "/Größe\u2013“😀”"

EACH = """
import os, sys
from nep.cli import main
for line in sys.stdin.buffer.read().decode().split("\\n"):
    sys.argv = ["nep", *line.split("\\t")]
    try:
        main()
    except SystemExit as ended:
        os.write(2, f"\\ncode {ended.code} of {sys.argv[1:]!a}\\n".encode())
"""


def environment(**more):
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("LC_", "LANG", "PYTHON"))}
    return {**kept, "PYTHONPATH": str(REPOSITORY), "COLUMNS": "100", **more}


@pytest.fixture
def talkers(master):
    """Node with topics and payloads that contain control sequences and characters missing in code pages."""
    with nep.node("Pépper 😀 “x”") as node:
        pubs = [node.new_pub(TOPIC, latched=True), node.new_pub("text", "string", latched=True)]
        pubs[0].publish({"said": NASTY, "ключ": [1, 2]})
        pubs[1].publish(NASTY)
        pubs.append(node.new_pub("/nep/log", "nep/log", latched=True))
        pubs[2].publish({"level": "error", "text": f"{NASTY}\nsecond line", "node": NASTY, "name": NASTY})
        pubs.append(node.new_pub("raw", "bytes", latched=True))
        pubs[3].publish(bytes(range(256)))
        pubs.append(node.new_pub("broken", latched=True))
        pubs[4].publish_bytes("“😀".encode() + b"\xff")
        yield node


COMMANDS = (
    ("--help",), ("--version",), ("topic", "--help"), ("topic", "list"), ("topic", "list", "--json"),
    ("node", "list"), ("node", "list", "--json"), ("topic", "frobnicate…😀"), ("doctor",),
    ("doctor", "--json"), ("log", "-n", "1"), ("log", "-n", "1", "--json"), ("log", "--level", "…😀"),
    ("log", "--help"),
    ("topic", "echo", TOPIC, "-n", "1"), ("topic", "echo", TOPIC, "-n", "1", "--json"),
    ("topic", "echo", TOPIC, "said", "-n", "1"), ("topic", "echo", TOPIC, "said", "-n", "1", "--csv"),
    ("topic", "echo", TOPIC, "text", "-n", "2"), ("topic", "echo", "text", "raw", "broken", "-n", "3"),
    ("topic", "echo", "nobody…😀", "--timeout", "0.1"), ("topic", "hz", TOPIC, "-n", "1"),
    ("topic", "bw", TOPIC, "-n", "1", "--json"), ("topic", "pub", "new…😀", '{"a": "…😀"}'),
    ("topic", "pub", "text", "…😀", "--type", "json"), ("topic", "pub", "new", "@/no/such…😀"),
    ("topic", "pub", "bad topic", "1"), ("--master", "nosuchhost.invalid…😀", "topic", "list"), ("master",),
)  # fmt: skip


@pytest.mark.parametrize(
    "page",
    ["ascii", "cp1252", *(pytest.param(page, marks=pytest.mark.long) for page in ("cp437", "latin-1"))],
)
def test_commands_print_their_output_in_limited_code_pages(talkers, page):
    given = "\n".join("\t".join(words) for words in COMMANDS)
    done = subprocess.run(
        [sys.executable, "-c", EACH],
        input=given.encode(),
        capture_output=True,
        env=environment(PYTHONIOENCODING=page, PYTHONUTF8="0", LC_ALL="C"),
        timeout=LONG_S,
        check=False,
    )
    err = done.stderr.decode(page, "strict")
    assert "Traceback" not in err, err[-3000:]
    assert "Exception" not in err, err[-3000:]
    assert err.count("\ncode ") == len(COMMANDS)
    assert (done.stdout + done.stderr).count(b"\x1b") == 1, (
        "but in --csv, which is for programs, none is left"
    )
    if page == "ascii":
        text = done.stdout.decode("ascii", "ignore")
        assert '? - "two" -> \\x1b[2J' in text, "what it has no letters for is plainer, not gone"
        assert "/Gr??e-" in text


@pytest.mark.skipif(os.name != "posix", reason="Windows gives words as letters, not as bytes")
def test_arguments_in_another_encoding_are_read_as_utf_8(monkeypatch):
    monkeypatch.setattr("sys.argv", ["nep", "Gr\udcc3\udcb6\udcc3\udc9fe", "plain", "Größe"])
    assert command_line_arguments() == ["Größe", "plain", "Größe"]


def command(*words, env=None, **more):
    """Start a command as a process, as a shell does."""
    return subprocess.Popen(
        [sys.executable, "-m", "nep", *words],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=environment(PYTHONIOENCODING="utf-8", **(env or {})),
        **more,
    )


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="/dev/full is a device of Linux")
@pytest.mark.parametrize(
    ("words", "unbuffered"),
    [
        (("--help",), ""),
        (("topic", "list"), "1"),
        (("topic", "list", "--json"), ""),
        (("topic", "echo", TOPIC, "--csv", "said"), ""),
        (("topic", "echo", TOPIC, "--csv", "said"), "1"),
    ],
)
def test_full_disk_is_reported(talkers, words, unbuffered):
    env = {"PYTHONUNBUFFERED": unbuffered}  # set in many containers
    with FULL.open("w") as full, command(*words, stdout=full, env=env) as running:
        said = running.stderr.read().decode()
    assert running.returncode == 1
    assert said == f"nep: can't write the output: no space left on device{os.linesep}"


@pytest.mark.skipif(not FULL.exists(), reason="/dev/full is a device of Linux")
def test_full_error_stream_does_not_fail_the_command(talkers):
    with FULL.open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "nep", "topic", "pub", "new", "1"],
            stdout=subprocess.PIPE,
            stderr=full,
            env=environment(),
            timeout=LONG_S,
            check=False,
        )
    assert done.returncode == 0


OUT = "nep: can't write the output: it is closed\n"


@pytest.mark.skipif(sys.platform == "win32", reason="a shell of Unix closes streams")
@pytest.mark.parametrize(
    ("closed", "words", "code", "said"),
    [
        ("0<&-", "topic pub new -", 1, "nep: can't read standard input: it is closed\n"),
        ("0<&-", "topic list", 0, ""), ("0<&- 1>&-", "topic list", 1, OUT), ("1>&-", "--version", 1, OUT),
        ("1>&-", "topic list --json", 1, OUT), ("1>&-", "topic echo big --json", 1, OUT),
        ("1>&-", "topic echo text", 1, OUT), ("0<&- 1>&- 2>&-", "topic list", 1, ""),
        ("1>&-", "topic pub new 1", 0, "published 1 message on 'new' (json) to no subscribers\n"),
        ("2>&-", "topic echo nobody --timeout 0.1", 1, ""), ("2>&-", "topic pub new 1", 0, ""),
    ],
)  # fmt: skip
def test_closed_standard_stream_is_an_error_only_if_it_is_needed(talkers, closed, words, code, said):
    big = talkers.new_pub("big", latched=True)
    big.publish({"long": "x" * 100_000})
    done = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m nep {words} {closed}"],
        capture_output=True,
        env=environment(),
        timeout=LONG_S,
        check=False,
    )
    assert (done.returncode, done.stderr.decode()) == (code, said)


@pytest.mark.parametrize("words", [("--help",), ("topic", "list"), ("topic", "echo", TOPIC), ("log",)])
def test_closed_output_pipe_ends_the_command_silently(talkers, words):
    running = command(*words, stdout=subprocess.PIPE)
    running.stdout.close()
    ended = threading.Event()
    pub = talkers.new_pub(TOPIC)
    log = talkers.new_pub("/nep/log", "nep/log")

    def talk():
        while not ended.wait(0.02):
            pub.publish({"n": 1})
            log.publish({"text": "one more"})

    talking = threading.Thread(target=talk)
    talking.start()
    try:
        code = running.wait(LONG_S)
    finally:
        ended.set()
        talking.join()
        running.kill()
    said = running.stderr.read().decode()
    running.stderr.close()
    assert code == 1
    assert "Traceback" not in said
    assert "can't write" not in said
    assert "Exception" not in said


def test_failure_to_print_a_notice_does_not_end_a_command(monkeypatch):
    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError(errno.EPIPE, "gone")

    monkeypatch.setattr("sys.stderr", Gone())
    print_status("one")
    print_error_message("two")
    show_alerts([Alert("a", "three", "four")])


def test_full_disk_is_reported_also_for_more_output_than_a_buffer(talkers):
    if not FULL.exists():
        pytest.skip("/dev/full is a device of Linux")
    big = talkers.new_pub("big", latched=True)
    big.publish({"long": "x" * 100_000})
    with FULL.open("w") as full, command("topic", "echo", "big", "--json", stdout=full) as running:
        said = running.stderr.read().decode()
    assert running.returncode == 1
    assert said == f"nep: can't write the output: no space left on device{os.linesep}"
