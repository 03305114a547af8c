"""Tests of starting the master in the background: a failure is reported once and retried with back-off."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

import psutil
import pytest

import nep
from app.core.network.master import DISCOVERY_TIMEOUT_S, MAX_RETRY_S, MasterChangeDetector, MasterStarter
from nep.protocol.graph_view import GraphView
from tests.nep.programs import eventually

ROOT = Path(__file__).parents[3]


@pytest.fixture
def foreign():
    """Address of a program that is no master."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        held.listen(8)
        yield f"127.0.0.1:{held.getsockname()[1]}"


def test_foreign_program_at_master_address_is_named_once_and_retried_with_backoff(foreign) -> None:
    now = [0.0]
    told: list[str] = []
    start = MasterStarter(foreign, told.append, lambda: now[0])
    asked = []

    def ask() -> None:
        before = start._thread
        start.ensure_running_with_backoff()
        if start._thread is not before:
            asked.append(now[0])
            start.close()

    while now[0] < 100:
        ask()
        now[0] += 0.5
    assert asked == [0.0, 2.0, 6.0, 14.0, 30.0, 60.0, 90.0]
    assert asked[-1] - asked[-2] == MAX_RETRY_S
    assert len(told) == 1
    assert f"(process {os.getpid()}) uses port " in told[0]
    assert "NEP_MASTER=" in told[0]
    assert not start.has_started
    assert not [each for each in psutil.Process().children() if "master" in each.cmdline()]


def test_no_master_is_started_when_one_is_running(master) -> None:
    told: list[str] = []
    start = MasterStarter(master.address, told.append)
    start.ensure_running()
    start.close()
    assert (told, start.has_started, start.is_first_master) == ([], False, False)


@pytest.fixture
def free(monkeypatch) -> str:
    """Free address; the gateway is off, so that a master there meets no other master."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    monkeypatch.setenv("NEP_GATEWAY", "0")
    return address


def the_one_started(address: str) -> None:
    told: list[str] = []
    start = MasterStarter(address, told.append)
    start.ensure_running()
    start.ensure_running()  # must not start a second master
    eventually(lambda: start.has_started)
    assert start.is_first_master
    assert nep.is_running(address, 60)
    start.close()
    assert told == []
    assert start._process is not None
    start._process.terminate()
    start._process.wait(60)


def test_master_is_started_when_none_is_running(free) -> None:
    the_one_started(free)


@pytest.mark.skipif(os.name != "posix", reason="a program of one line is a shell's")
def test_packaged_studio_starts_its_own_executable_as_master(free, monkeypatch, tmp_path: Path) -> None:
    """A packaged Studio contains no Python for ``-m nep``, only an executable with Studio's options."""
    studio = tmp_path / "nep-studio"
    studio.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m app "$@"\n', "utf-8")
    studio.chmod(0o700)
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setattr(sys, "executable", str(studio))
    the_one_started(free)


def view(epoch: int) -> GraphView:
    return GraphView(epoch, 1, {}, {})


def test_graph_of_the_first_or_same_master_is_accepted_at_once() -> None:
    learning = MasterChangeDetector()
    assert not learning.is_incomplete(None, view(1), 0.0)
    assert not learning.is_incomplete(view(1), view(1), 1.0)


def test_graph_of_new_master_is_accepted_after_discovery_time() -> None:
    learning = MasterChangeDetector()
    assert learning.is_incomplete(view(1), view(2), 10.0)
    assert learning.is_incomplete(view(1), view(2), 10.0 + DISCOVERY_TIMEOUT_S - 0.1)
    assert not learning.is_incomplete(view(1), view(2), 10.0 + DISCOVERY_TIMEOUT_S)


def test_third_master_restarts_discovery_time() -> None:
    learning = MasterChangeDetector()
    learning.is_incomplete(view(1), view(2), 10.0)
    assert learning.is_incomplete(view(1), view(3), 10.0 + DISCOVERY_TIMEOUT_S)
