"""Tests of commands in a faulty environment: no network, a port in use, no free port, unwritable folders.

Each command must end with an error that names the next step, never with a traceback.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from nep.cli.alert_printer import AlertTracker
from nep.errors import AddressInUseError
from nep.protocol.graph_view import Alert, GraphView

REPOSITORY = Path(__file__).resolve().parents[3]
LONG_S = 120
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONIOENCODING": "utf-8", "COLUMNS": "300"}
UP = "ip link set lo up"
START_MASTER = "pipe=$(mktemp -u); mkfifo $pipe; NEP master 2>$pipe & master=$!; exec 3<$pipe; rm $pipe"
"""Shell commands that start a master whose error stream is file descriptor 3."""


def alone(script: str, *, up: bool) -> subprocess.CompletedProcess[str]:
    """Run a shell script in its own network namespace, with the loopback interface up or down.

    Skip the test where network namespaces are not available.
    """
    unshare = shutil.which("unshare")
    if unshare is None or shutil.which("ip") is None:
        pytest.skip("a network of one's own needs Linux with unshare and ip")
    if subprocess.run([unshare, "-rn", "true"], check=False, capture_output=True).returncode:
        pytest.skip("this computer does not permit networks of one's own (unshare -rn)")
    commands = textwrap.dedent(script).replace("START_MASTER", START_MASTER)
    lines = [UP if up else "true", "cd /", commands.replace("NEP", f"{sys.executable} -m nep")]
    return subprocess.run(
        [unshare, "-rn", "sh", "-c", "\n".join(lines)],
        env={**ENVIRONMENT, "NEP_MASTER": "127.0.0.1:7780", "NEP_GATEWAY": "0"},
        capture_output=True,
        encoding="utf-8",
        timeout=LONG_S,
        check=False,
    )


def test_commands_work_with_only_the_loopback_interface():
    done = alone(
        """
        START_MASTER
        read said <&3
        NEP topic pub words '"hello"' --latched >/dev/null 2>&1 & pub=$!
        NEP topic echo words -n 1
        NEP doctor; echo "doctor $?"
        kill $pub $master
        """,
        up=True,
    )
    assert "#1  hello" in done.stdout
    assert "A master has been running at 127.0.0.1:7780" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr


def test_disabled_loopback_is_reported_by_the_doctor_and_commands_print_no_traceback():
    done = alone(
        """
        NEP doctor --json
        NEP node list; echo "list $?" >&2
        START_MASTER
        while read said <&3; do
            echo "$said" >&2
            case $said in *"can't reach the master"*) break ;; esac
        done
        kill $master
        cat <&3 >&2
        """,
        up=False,
    )
    found = {each["id"]: each for each in json.loads(done.stdout.splitlines()[0])}
    assert found["loopback"]["severity"] == "error"
    assert found["loopback"]["command"] == "ip link set lo up"
    assert "no master replied at '127.0.0.1:7780'" in done.stderr
    assert "list 1" in done.stderr
    assert (
        "programs on this computer can't reach the master: network is unreachable; run 'nep doctor'"
        in done.stderr
    )
    assert "Traceback" not in done.stderr


def test_node_without_a_free_port_raises_an_error():
    code = """
import nep
with nep.Master("127.0.0.1:7780", learn_s=0.0), nep.node("many") as node:
    try:
        for number in range(10):
            node.new_pub(f"t{number}")
    except nep.NepError as error:
        print(error)
"""
    done = alone(
        f"""
        echo "40000 40003" > /proc/sys/net/ipv4/ip_local_port_range || exit 77
        {sys.executable} -c '{code}'
        """,
        up=True,
    )
    if done.returncode == 77:
        pytest.skip("the range of ports cannot be made small here")
    assert done.stdout.strip() == "no port of '127.0.0.1' is free; close programs that have many connections"
    assert "Traceback" not in done.stderr


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "nep", *arguments],
        env={**ENVIRONMENT, **environment},
        capture_output=True,
        encoding="utf-8",
        timeout=LONG_S,
        check=False,
    )


def test_master_names_the_foreign_program_that_holds_its_port():
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        held.listen(8)
        port = held.getsockname()[1]
        done = run("master", "--no-gateway", NEP_MASTER=f"127.0.0.1:{port}")
    assert done.returncode == 1
    assert done.stderr.startswith("nep: “")
    assert f"(process {os.getpid()}) uses port {port} but isn't a master; close that program" in done.stderr
    assert f"NEP_MASTER=127.0.0.1:{port + 1}" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps permissions in another way")
def test_doctor_reports_an_unwritable_state_folder(tmp_path, type_in, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NEP_STATE_DIR", str(tmp_path / "file" / "state"))
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")
    done = type_in("doctor", "--json")
    (found,) = [each for each in json.loads(done.stdout) if each["id"].startswith("folder:")]
    assert found["severity"] == "error"
    assert "not a directory" in found["sentence"]
    assert done.returncode == 2


def test_invalid_master_address_is_reported(type_in, monkeypatch):
    monkeypatch.setenv("NEP_MASTER", "no address at all")
    done = type_in("node", "list")
    assert done.returncode == 1
    assert done.stderr.startswith("nep: 'no address at all:7780' isn't a valid address of a master")


def test_address_in_use_error_for_any_port_names_the_host():
    assert str(AddressInUseError("127.0.0.1:*")).startswith("no port of '127.0.0.1' is free; ")
    assert str(AddressInUseError("127.0.0.1:5")).startswith("'127.0.0.1:5' is in use by another program; ")


def test_alerts_are_reported_when_raised_changed_and_resolved():
    changes = AlertTracker()
    first, other = Alert("a", "one"), Alert("a", "two")
    assert changes.update(GraphView(1, 1, alerts=(first,))) == ([first], [])
    assert changes.update(GraphView(1, 2, alerts=(first,))) == ([], [])
    assert changes.update(GraphView(1, 3, alerts=(other,))) == ([other], [])
    assert changes.update(GraphView(1, 4)) == ([], [other])
