from __future__ import annotations

import os
import socket
import subprocess
import sys

from nep.programs.gateway.processes import SystemProcesses

PROCESSES = SystemProcesses()


def test_process_start_and_language_are_known_until_it_ends():
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        assert PROCESSES.start_time_s(child.pid) is not None
        assert PROCESSES.language(child.pid) == "python"
    finally:
        child.communicate(b"\n")
    assert PROCESSES.start_time_s(child.pid) is None
    assert PROCESSES.language(child.pid) is None
    assert PROCESSES.is_connected(child.pid, 1, is_bound_by_process=False) is False


def test_connection_of_a_process_to_a_port_is_detected():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert not PROCESSES.is_connected(os.getpid(), port, is_bound_by_process=False)
        with socket.create_connection(("127.0.0.1", port)) as connection:
            assert PROCESSES.is_connected(os.getpid(), port, is_bound_by_process=False)
            assert not PROCESSES.is_connected(
                os.getpid(), connection.getsockname()[1] + 1, is_bound_by_process=False
            )
            accepted, _ = server.accept()
            with accepted:
                assert PROCESSES.is_connected(os.getpid(), port, is_bound_by_process=True)
