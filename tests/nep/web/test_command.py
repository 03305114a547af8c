"""Tests of the command `nep web`: its URL, tokens and error messages."""

from __future__ import annotations

import os
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.sync.client import connect

from nep.masters.master import Master
from tests.nep.cli.conftest import TypeIn
from tests.nep.cli.conftest import type_in as type_in
from tests.nep.programs import running
from tests.nep.web.conftest import Peer

COMMAND = "import sys; from nep.cli import main; sys.argv[0] = 'nep'; sys.stderr = sys.stdout; main()"


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        yield int(taken.getsockname()[1])


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_command_serves_with_a_token_until_terminated(master: Master, tmp_path: Path) -> None:
    file = tmp_path / "token"
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with running(COMMAND, "web", "--port", str(port), "--token", str(file)) as program:
        line = program.line()
        token = file.read_text("utf-8").strip()
        assert line.endswith(f"ws://127.0.0.1:{port}/?token={token}")
        assert file.stat().st_mode & 0o777 == 0o600
        with connect(f"ws://127.0.0.1:{port}/?token={token}") as connection:
            assert Peer(connection).refusal("nothing")
            program.signal(signal.SIGTERM)
            out, err = program.end()
        assert program.process.returncode == 0
        assert "1 rejected" in out
        assert err == ""


def test_command_suggests_a_solution_when_the_server_cannot_start(
    master: Master, taken_port: int, tmp_path: Path, type_in: TypeIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        free_port = str(probe.getsockname()[1])
    short = tmp_path / "short"
    short.write_text("1234")
    for words, hint in (
        (("--port", str(taken_port)), "--port"),
        (("--port", free_port, "--listen", "192.0.2.7"), "192.0.2.7"),
        (("--listen", "http://x"), "URL"),
        (("--origin", "example.org"), "http://192.168.1.5:8000"),
        (("--token", str(short)), str(short)),
        (("--token", str(tmp_path)), str(tmp_path)),
    ):
        ended = type_in("web", *words)
        assert ended.returncode == 1
        assert hint in ended.stderr
        assert "Traceback" not in ended.stderr
    for module in ("websockets.asyncio.server", "cbor2", "websockets"):  # too old, or a missing extra
        monkeypatch.setitem(sys.modules, module, None)
        ended = type_in("web", "--port", str(taken_port))
        assert (ended.returncode, ended.stderr.count("\n")) == (1, 1)
        assert "nep-studio[web]" in ended.stderr
    assert os.listdir(tmp_path) == ["short"]  # noqa: PTH208
