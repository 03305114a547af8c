"""Tests of the facts that `nep doctor` collects on the real computer, and of the command itself."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest
import typer

import nep
from nep.cli.programs.doctor import doctor
from nep.programs.doctor import collect_facts, installs, processes, start_blocker
from nep.programs.doctor.collect import loopback_problem
from tests.nep.programs import running

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture
def foreign():
    """Port on which the test process listens without being a master."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        held.listen(1)
        yield held.getsockname()[1]


def test_local_master_is_found_with_its_process(master):
    with nep.node("Pepper") as node:
        node.new_pub("/odom")
        began = time.monotonic()
        facts = collect_facts(master.address)
        took_s = time.monotonic() - began
    assert {each.name for each in facts.view.nodes.values()} == {"Pepper"}
    assert 0.0 < facts.reply_time_s < took_s  # part of the whole collection time
    assert facts.master_port.is_taken
    assert facts.master_port.holder.pid == os.getpid()
    assert facts.loopback_problem == ""
    assert facts.versions["Python"].startswith("3.")
    assert Path(facts.nep_folder) == Path(nep.__file__).parent


def test_process_that_holds_the_port_is_found(foreign):
    facts = collect_facts(f"127.0.0.1:{foreign}")
    assert facts.view is None
    assert facts.master_port.holder.pid == os.getpid()
    assert not facts.master_port.holder.is_master
    assert not processes.is_free(foreign)


def test_free_port_is_reported_as_free():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    facts = collect_facts(f"127.0.0.1:{port}")
    assert not facts.master_port.is_taken
    assert processes.is_free(port)


def installed(environment: Path, version: str, place: str = "lib/python3.11/site-packages") -> Path:
    info = environment / place / f"nep_studio-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: nep-studio\nVersion: {version}\n")
    return info


@pytest.mark.parametrize("place", ["lib/python3.11/site-packages", "Lib/site-packages"])
def test_version_is_read_from_the_environment_of_a_program(tmp_path, place):
    info = installed(tmp_path, "0.0.9", place)
    os.utime(info / "METADATA", (1000, 1000))
    assert installs.install_in(tmp_path) == installs.Install("0.0.9", 1000.0, str(tmp_path))
    (info / "METADATA").unlink()
    assert installs.install_in(tmp_path) is None


def test_environment_with_no_or_two_installations_has_no_version(tmp_path):
    assert installs.install_in(tmp_path) is None
    installed(tmp_path, "0.0.9")
    installed(tmp_path, "0.1.0")
    assert installs.install_in(tmp_path) is None


@pytest.mark.parametrize(
    ("command", "active", "environment"),
    [
        (["/x/.venv/bin/python3", "-m", "nep", "master"], "", "/x/.venv"),
        ([".venv/bin/python", "/x/.venv/bin/nep", "master"], "", "/home/me/.venv"),
        (["python3", "-m", "nep", "master"], "/y/env", "/y/env"),
        (["python3", "-m", "nep", "master"], "", "/usr"),
        (["nep", "master"], "", "/usr"),
        ([], "", "/usr"),
    ],
)
def test_environment_of_a_program_is_found(command, active, environment):
    found = installs.environment_of(command, "/usr/bin/python3.11", "/home/me", active)
    assert found == Path(environment)


def test_installer_package_has_no_python_environment():
    assert installs.environment_of(["nep-studio"], "/opt/nep-studio", "/") is None


def test_version_of_a_running_master_is_collected(tmp_path, master, monkeypatch):
    asked = []
    known = installs.Install("0.0.9", 1000.0, str(tmp_path))
    monkeypatch.setattr(installs, "install_of", lambda pid: asked.append(pid) or known)
    assert collect_facts(master.address).master_install == known
    assert asked == [os.getpid()]
    assert collect_facts("127.0.0.1:1").master_install is None


def test_ended_program_has_no_version():
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    assert installs.install_of(done.pid) is None


def test_port_of_a_remote_master_is_not_checked_locally():
    assert collect_facts("192.0.2.1:7780").master_port is None


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps permissions in another way")
def test_unwritable_folders_are_reported_with_the_reason(tmp_path):
    file = tmp_path / "file"
    file.touch()
    facts = collect_facts("127.0.0.1:1", folders=[("Settings", tmp_path / "new"), ("Work", file / "below")])
    problems = {fact.purpose: fact.problem for fact in facts.folders}
    assert problems["Settings"] == ""
    assert problems["Work"] == "not a directory"
    assert not (tmp_path / "new").exists()
    assert list(tmp_path.iterdir()) == [file]


def test_file_that_shadows_the_package_is_found(tmp_path):
    assert collect_facts("127.0.0.1:1", working_folder=tmp_path).shadowing_file == ""
    (tmp_path / "nep.py").touch()
    assert collect_facts("127.0.0.1:1", working_folder=tmp_path).shadowing_file == str(tmp_path / "nep.py")
    assert collect_facts("127.0.0.1:1", working_folder=REPOSITORY).shadowing_file == ""


def test_loopback_check_passes():
    assert loopback_problem() == ""


@pytest.mark.parametrize(
    ("command", "is_master"),
    [
        (["/usr/bin/python3", "-m", "nep", "master"], True),
        (["/x/bin/nep", "master", "--port", "1"], True),
        (["nep-studio", "--module", "nep", "master"], True),
        (["nep", "topic", "pub", "master", "1"], False),
        (["git", "checkout", "master"], False),
        ([], False),
    ],
)
def test_master_process_is_recognised_by_its_command_line(command, is_master):
    assert processes.is_master_command(command) is is_master


def test_exit_code_is_the_worst_severity(foreign, capfdbinary):
    with pytest.raises(typer.Exit) as ended:
        doctor(f"127.0.0.1:{foreign}", as_json=True)
    assert ended.value.exit_code == 2
    (first, *_) = json.loads(capfdbinary.readouterr().out)
    assert (first["id"], first["severity"]) == ("master:foreign", "error")


def test_text_output_has_a_sentence_and_the_next_step(foreign):
    done = subprocess.run(
        [sys.executable, "-m", "nep", "doctor", "--master", f"127.0.0.1:{foreign}"],
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONIOENCODING": "utf-8"},
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("✗ “")
    assert lines[0].endswith(f" uses port {foreign} but isn't a master.")
    assert lines[2].strip() == f"nep master --port {foreign + 1}"


def test_reason_why_a_master_cannot_start_is_one_finding(foreign, master):
    one = start_blocker(f"127.0.0.1:{foreign}")
    assert one is not None
    assert one.id == "master:foreign"
    assert f"(process {os.getpid()}) uses port {foreign} " in one.error_message
    assert "; close that program" in one.error_message
    assert not one.error_message.endswith(".")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = probe.getsockname()[1]
    assert start_blocker(f"127.0.0.1:{free}") is None


def test_lingering_connections_of_a_killed_program_do_not_hold_its_port():
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket() as client:
        address = server.getsockname()
        client.connect(address)
        accepted, _ = server.accept()
        accepted.close()  # the server's end of the connection is now in FIN-WAIT-2
        server.close()
        assert processes.is_free(address[1])


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_programs_with_nodes_are_checked_for_their_open_files(master):
    code = """
    import resource, sys, nep
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
    node = nep.node("Pepper")
    pub = node.new_pub("topic")
    print("ready")
    sys.stdin.readline()
    """
    with running(code, NEP_MASTER=master.address) as program:
        program.line()
        (found,) = collect_facts(master.address).programs
        assert (found.pid, found.name) == (program.process.pid, "Pepper")
        assert 5 < found.open_count < 100
        assert found.limit == 256 or sys.platform == "darwin"


def test_listener_on_another_address_does_not_hold_the_port_on_loopback():
    listens = psutil.CONN_LISTEN
    for order in (1, -1):
        sockets = [
            SimpleNamespace(status=listens, laddr=SimpleNamespace(ip=ip, port=7000), pid=pid)
            for ip, pid in (("127.0.0.1", 41), ("192.168.1.5", 77))
        ]
        assert processes.port_holders(sockets[::order]) == {7000: 41}


@pytest.mark.skipif(sys.platform == "win32", reason="its python.exe may be a launcher of another process")
def test_program_started_with_inline_code_is_not_named_by_its_source():
    text = "import sys; print(flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        child.stdout.readline()
        assert "import" not in processes.process_fact(child.pid).name
        child.stdin.close()
