"""Tests of bridges with ROS 2 in a separate network namespace; see tests/nep/backends/test_ros2.py."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.nep.backends.test_ros2 import NAMESPACE, NEEDS, why_not

HERE = Path(__file__).parent


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_ros_2_bridge_tests_pass_in_an_isolated_network() -> None:
    pytest.importorskip("cyclonedds", reason=NEEDS)
    pytest.importorskip("rosbags", reason=NEEDS)
    if reason := why_not():
        pytest.skip(reason)
    known = {key: value for key, value in os.environ.items() if not key.startswith(("ROS_", "CYCLONEDDS_"))}
    file = str(HERE / "ros2_bridge_child.py")
    done = subprocess.run(
        [*NAMESPACE, sys.executable, "-m", "pytest", "-q", "-n0", "--color=no", file],
        env=known | {"NEP_TEST_ROS2": "1"},
        cwd=HERE.parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-2000:]
    assert " passed" in done.stdout
