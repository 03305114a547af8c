"""Tests of observing real ROS 1 and ROS 2 networks, each in a separate process (`watching_child`)."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.core.network_of_ones_own import alone
from tests.nep.backends.ros_programs import skip_without_ros

PROGRAM = ("-m", "tests.core.networks.watching_child")
TWIST = {"linear": {"x": 1.5, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


def told(done: subprocess.CompletedProcess[str]) -> dict[str, object]:
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert isinstance(seen, dict)
    return seen


def test_ros_1_is_observed_and_received_and_loss_of_its_master_is_detected() -> None:
    skip_without_ros()
    done = subprocess.run(
        [sys.executable, *PROGRAM, "ros"], capture_output=True, encoding="utf-8", timeout=120, check=False
    )
    seen = told(done)
    assert seen["payloads"] == [TWIST, {"data": "hello"}]
    assert seen["types"] == ["geometry_msgs/Twist", "std_msgs/String"]
    assert (seen["generations"], seen["cpu"], seen["seq"]) == (["ros"], [None], [None, None])
    assert (seen["native"], seen["gone"], seen["left"]) == ([], [True, True], ["off", 0])
    assert str(seen["lost"]).startswith("no ROS master replied at '127.0.0.1:")


def test_ros_2_is_observed_and_received_including_best_effort_publishers() -> None:
    pytest.importorskip("cyclonedds")
    pytest.importorskip("rosbags")
    seen = told(alone(*PROGRAM, "ros2", up=True, timeout_s=120))
    assert seen["payloads"] == [TWIST, "hello"]
    assert seen["types"] == ["geometry_msgs/msg/Twist", "string"]
    assert (seen["cpu"], seen["seq"]) == ([None], [None, None])
    assert (seen["native"], seen["gone"], seen["left"]) == ([], [True, True], ["off", 0])
