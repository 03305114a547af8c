"""Helper that runs Python in a network namespace with nothing but the loopback, up or down (Linux)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


def alone(
    *arguments: str, up: bool, timeout_s: float, silent: str = "", **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python with these arguments in a new network namespace; skip the test where it isn't permitted.

    Args:
        arguments: Arguments of the Python interpreter.
        up: Whether the loopback interface is up.
        timeout_s: Time limit of the process in seconds.
        silent: Address with prefix length (10.9.9.1/24) of an extra interface that drops all packets,
            as a firewall does; "" for none.
        environment: Additional environment variables.
    """
    unshare = shutil.which("unshare")
    if unshare is None or shutil.which("ip") is None:
        pytest.skip("a network of one's own needs Linux with unshare and ip")
    if subprocess.run([unshare, "-rn", "true"], check=False, capture_output=True).returncode:
        pytest.skip("this computer does not permit networks of one's own (unshare -rn)")
    first = "ip link set lo up; " if up else ""
    if silent:  # packets sent to this device are dropped silently
        first += "ip link add fire type ifb && ip link set fire up && "
        first += f"ip address add {silent} dev fire || exit 77; "
    done = subprocess.run(
        [unshare, "-rn", "sh", "-c", f'{first}exec "$@"', "sh", sys.executable, *arguments],
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "NEP_MASTER": "127.0.0.1:7780", **environment},
        capture_output=True,
        encoding="utf-8",
        timeout=timeout_s,
        check=False,
    )
    if silent and done.returncode == 77:
        pytest.skip("this computer has no network that swallows everything (ifb)")
    return done
