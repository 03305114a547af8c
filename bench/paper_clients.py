"""Rows of `paper.py` in which Python pings a program that uses nep.js, NEP for C# or rosnodejs."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).parent
CLIENTS = HERE.parent / "clients"
JAVASCRIPT, CSHARP = "nep with nep.js", "nep with C#"
ROSNODEJS = "rospy with rosnodejs"
ROWS = (JAVASCRIPT, CSHARP)
"""Rows whose ping is nep."""
PACKAGE = CLIENTS / "javascript" / "dist" / "index.js"
STD_MSGS = Path("/usr/share/std_msgs/msg")
JSON_LIBRARY = Path("/usr/lib/cli/Newtonsoft.Json-5.0/Newtonsoft.Json.dll")


def why_missing(row: str) -> str:
    """Return why a row can't be run on this computer, or an empty string."""
    if row == JAVASCRIPT:
        has_node = shutil.which("node") and PACKAGE.is_file()
        return "" if has_node else "needs node, and `npm ci && npm run build` in clients/javascript"
    has_mono = shutil.which("mcs") and shutil.which("mono") and JSON_LIBRARY.is_file()
    return "" if has_mono else "needs mono-mcs, mono-runtime and libnewtonsoft-json5.0-cil"


def pong(row: str, folder: Path, types: Mapping[str, str]) -> tuple[str, ...]:
    """Return the command of pong; ``types`` has the message type of each kind. C# is built in ``folder``."""
    if row == JAVASCRIPT:
        return ("node", str(HERE / "pong.cjs"), str(PACKAGE), json.dumps(types))
    program = folder / "Pong.exe"
    if not program.exists():
        sources = [*sorted((CLIENTS / "csharp" / "src").rglob("*.cs")), HERE / "Pong.cs"]
        options = ("-langversion:7", "-optimize+", "-nowarn:0649,0169", f"-r:{JSON_LIBRARY}")
        subprocess.run(["mcs", *options, f"-out:{program}", *map(str, sources)], check=True)
    return ("mono", str(program), json.dumps(types))


def why_no_rosnodejs(package: str) -> str:
    """Return why rosnodejs in the folder ``package`` can't be run on this computer, or an empty string."""
    if not package:
        return "no folder of rosnodejs was given"
    if not (shutil.which("node") and (Path(package) / "package.json").is_file()):
        return f"needs node, and '{package}' to be the folder that `npm install rosnodejs` makes"
    return "" if STD_MSGS.is_dir() else "needs ros-std-msgs"


def rosnodejs_pong(package: str, folder: Path, kinds: Sequence[str]) -> tuple[str, ...]:
    """Return the command of pong of `ROSNODEJS`; message definitions are copied to ``folder``."""
    messages = folder / "ros" / "std_msgs"
    if not messages.exists():
        shutil.copytree(STD_MSGS, messages / "msg")
        about = '<package format="2"><name>std_msgs</name><version>0.0.0</version></package>\n'
        (messages / "package.xml").write_text(about, encoding="utf-8")
    found = f"ROS_PACKAGE_PATH={messages.parent}"
    return ("env", found, "node", str(HERE / "pong_ros.cjs"), package, json.dumps(kinds))


def versions() -> dict[str, str]:
    """Return the versions of Node.js and Mono, as far as they are installed."""
    found = {}
    for name, command in (("Node.js", "node"), ("Mono", "mono")):
        if shutil.which(command):
            done = subprocess.run([command, "--version"], capture_output=True, text=True, check=False)
            words = done.stdout.split("\n", 1)[0].removeprefix("Mono JIT compiler version ").split()
            found[name] = words[0].removeprefix("v") if words else "?"
    return found
