"""Test of the gateway in an unwritable folder: it serves programs of the original NEP and raises an alert."""

from __future__ import annotations

import sys

import pytest

from nep.programs.gateway.gateway import Gateway
from nep.programs.gateway.processes import SystemProcesses

pytestmark = [
    pytest.mark.ports,
    pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps permissions in another way"),
]


def test_unwritable_folder_raises_an_alert_and_originals_are_served(fixed_ports, native, original, tmp_path):
    (tmp_path / "file").touch()
    gateway = Gateway(native, SystemProcesses(), tmp_path / "file" / "map.json")
    try:
        assert gateway.start()
        assert original.ask("t")["state"] == "success"
        native.wait(lambda: "gateway:file" in native.alerts)
    finally:
        gateway.close()
    assert "Can't save the ports" in native.alerts["gateway:file"]
