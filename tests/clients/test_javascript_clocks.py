"""Tests of the latency between JavaScript and Python programs on computers with different clocks."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from nep.system.computer import computer_id
from tests.clients.node_programs import NEEDS_NODE, PACKAGE, build_package, node, running_script
from tests.nep.backends.test_other_clocks import check_corrected, heard, is_near
from tests.nep.programs import eventually

pytestmark = NEEDS_NODE
ELSEWHERE = """\
const fs = require("node:fs");
const read = fs.readFileSync;
const isBootId = (path) => path === "/proc/sys/kernel/random/boot_id";
fs.readFileSync = (path, ...more) => (isBootId(path) ? "elsewhere" : read(path, ...more));
const now = Date.now;
Date.now = () => now() - 86_400_000 * 400;
const nep = require("nep-js");

const node = new nep.Node("far");
const far = node.new_pub("/far");
const seen = node.new_pub("/seen");
node.subscribe("/near", (message) => {
  seen.publish({ latency: message.latencyS, uncertainty: message.latencyUncertaintyS ?? null });
});
setInterval(() => far.publish({ x: 1 }), 20);
"""
SHIFT_S = -86_400.0 * 400


@pytest.mark.usefixtures("patient")
def test_clocks_of_two_computers_are_compared_and_corrected(tmp_path: Path) -> None:
    build_package()
    with Master("127.0.0.1:0", learn_s=0.0) as master, nep.node("here", master=master.address) as own:
        far, seen = own.new_sub("/far", keep="latest"), own.new_sub("/seen")
        near = own.new_pub("/near")
        with running_script(ELSEWHERE, tmp_path, NEP_MASTER=master.address):
            check_corrected(heard(far, is_near), SHIFT_S)

            def is_corrected() -> bool:
                near.publish({"x": 1})
                message = seen.receive(0.05)
                told = None if message is None else message.payload
                return isinstance(told, dict) and bool(told["uncertainty"]) and abs(told["latency"]) < 1.0

            eventually(is_corrected)


def test_computer_id_matches_that_of_python() -> None:
    build_package()
    script = f"console.log(require({str(PACKAGE / 'dist' / 'system' / 'computer.js')!r}).computerId())"
    done = subprocess.run([str(node), "-e", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == computer_id()
