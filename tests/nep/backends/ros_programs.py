"""Helpers for tests with Debian's ROS: a ROS master in its own process, and a check that ROS is there."""

from __future__ import annotations

import http.client
import os
import random
import shutil
import socket
import subprocess
import tempfile
import xmlrpc.client
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from nep.backends.ros.library import SEARCH_FOLDERS
from tests.nep.programs import eventually

NEEDED = ("rospy", "rosmaster", "std_msgs", "sensor_msgs", "geometry_msgs")
NO_ROS = (
    "ROS 1 is missing (Debian: python3-rospy python3-rosmaster python3-sensor-msgs python3-geometry-msgs)"
)
HAS_ROS = shutil.which("rosmaster") is not None and any(
    all((Path(place) / each).is_dir() for each in NEEDED) for place in SEARCH_FOLDERS
)
FIND_ROS = "from nep.backends.ros.library import get_rospy; get_rospy()\nimport rospy\n"
"""First lines of a program that uses ROS and not nep."""


def skip_without_ros() -> None:
    """Skip the test when ROS is not installed.

    All skips come from this line, so pytest reports them as one.
    """
    if not HAS_ROS:
        pytest.skip(NO_ROS)


def free_port() -> int:
    """Return a free port below those that the system assigns to other programs meanwhile."""
    while True:
        port = random.randrange(21_000, 32_000)
        with socket.socket() as free, suppress(OSError):
            free.bind(("127.0.0.1", port))
            return port


def answers(uri: str) -> bool:
    try:
        with xmlrpc.client.ServerProxy(uri) as proxy:
            return proxy.getPid("/test")[0] == 1  # type: ignore[index]
    except (OSError, http.client.HTTPException):
        return False


def told(address: str) -> dict[str, str]:
    """Return the environment variables of a ROS program."""
    return {
        "ROS_MASTER_URI": f"http://{address}",
        "ROS_IP": "127.0.0.1",
        "ROS_LOG_DIR": tempfile.gettempdir(),
    }


@contextmanager
def ros_master(folder: Path, address: str = "") -> Iterator[str]:
    """Run a ROS master and yield its address; the master is killed at the end."""
    address = address or f"127.0.0.1:{free_port()}"
    environment = {
        **os.environ, "ROS_MASTER_URI": f"http://{address}", "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": str(folder)
    }  # fmt: skip
    told = ["rosmaster", "--core", "-p", address.rpartition(":")[2]]
    with subprocess.Popen(
        told, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            eventually(lambda: answers(f"http://{address}"))
            yield address
        finally:
            process.kill()
