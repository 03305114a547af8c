"""Test an installation of nep without extras; print the failures and exit with 1 if there are any.

    python -I tools/library_alone.py    run by `python3 dev.py versions`; -I excludes local sources

Tests messages of all plain types with and without a master, a service, the error for a missing extra, the
command line (also in Spanish), and that all modules can be imported without Qt and the other extras.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import pkgutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import nep

ABSENT = ("PySide6", "shiboken6", "numpy", "cv2", "pynng", "zenoh", "iceoryx2", "cyclonedds", "pytest")
"""Packages of the extras. If one of them is installed, the test is meaningless and fails."""
MESSAGES = {
    "json": {"number": 1, "text": "ñ"},
    "string": "ñandú",
    "bytes": b"\0\xff",
    "msgpack": [None, b"x"],
}
WAIT_S = 30.0
EXTRAS = {"nanomsg": "nanomsg", "zenoh": "zenoh", "ros2": "ros2"}
"""Extra that the error for an unavailable back end must mention, by name of the back end."""


def check_installation() -> list[str]:
    """Check that nep is imported from the installation and no extra is installed; return the failures."""
    faults = [f"{name} is installed" for name in ABSENT if importlib.util.find_spec(name)]
    if not Path(nep.__file__).is_relative_to(sys.prefix):
        faults.append(f"nep was imported from {nep.__file__}, not from {sys.prefix}")
    return faults


def check_imports() -> list[str]:
    """Check that all modules of nep, including back ends, can be imported; return the failures."""
    faults = []
    for module_info in pkgutil.walk_packages(nep.__path__, "nep."):
        if module_info.name == "nep.__main__":  # runs the command when imported
            continue
        try:
            importlib.import_module(module_info.name)
        except ImportError as error:
            faults.append(f"{module_info.name} can't be imported: {error}")
    return faults


def check_messages(master: str | None) -> list[str]:
    """Check messages of all plain types; return the failures.

    Args:
        master: Address of the master, or None for the back end "memory".
    """
    backend = "zeromq" if master else "memory"
    faults = []
    with (
        nep.node("talker", backend, master=master) as talker,
        nep.node("listener", backend, master=master) as listener,
    ):
        for msg_type, sent in MESSAGES.items():
            subscriber = listener.new_sub(msg_type, msg_type)
            talker.new_pub(msg_type, msg_type).publish(sent)
            message = subscriber.receive(WAIT_S)
            if message is None or message.payload != sent:
                faults.append(f"{backend}: published {sent!r}, received {message!r}")
    return faults


def _sum(request: Any) -> dict[str, int]:  # noqa: ANN401 - whatever JSON a client sends
    return {"sum": sum(request["of"])}


def check_services(master: str) -> list[str]:
    """Check a service whose server runs in a separate thread; return the failures."""
    with nep.node("server", master=master) as server, nep.node("caller", master=master) as caller:
        server.new_server("sum", _sum, threads=1)
        reply = caller.new_client("sum", timeout_s=WAIT_S).call({"of": [1, 2, 3]})
    return [] if reply == {"sum": 6} else [f"the service replied {reply!r}"]


def check_missing_extras(master: str) -> list[str]:
    """Check that the error for a missing package names its extra; return the failures."""
    faults = []
    with nep.node("painter", master=master) as node:
        try:
            node.new_pub("picture", "image").publish(object())
            faults.append("publishing an image needs no extra")
        except nep.EncodeError as error:
            if "nep-studio[image]" not in str(error):
                faults.append(f"the error for an image doesn't name its extra: {error}")
    for backend, extra in EXTRAS.items():
        try:
            nep.node("other", backend).close()
            faults.append(f"{backend} needs no extra")
        except nep.NepError as error:
            if f"nep-studio[{extra}]" not in str(error):
                faults.append(f"the error for {backend} doesn't name its extra: {error}")
    return faults


def check_command_line(master: str) -> list[str]:
    """Check the installed command `nep`; return the failures."""
    faults = []
    for arguments in (["--help"], ["--master", master, "topic", "list"], ["--master", master, "doctor"]):
        completed = _run_nep(arguments)
        # 1: the doctor found a problem of this computer.
        allowed = {0, 1} if "doctor" in arguments else {0}
        if "Traceback" in completed.stderr or completed.returncode not in allowed:
            faults.append(
                f"nep {' '.join(arguments)} exited with {completed.returncode}: {completed.stderr[-500:]}"
            )
    if _run_nep(["--help"], "es").stdout == _run_nep(["--help"]).stdout:
        faults.append("nep --help is the same in Spanish and English: the translations are missing")
    return faults


def _run_nep(arguments: list[str], language: str = "en") -> subprocess.CompletedProcess[str]:
    # Runs the installed script in a language.
    script = Path(sys.executable).with_name("nep.exe" if sys.platform == "win32" else "nep")
    return subprocess.run(
        [str(script), *arguments],
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=2 * WAIT_S,
        env={**os.environ, "NEP_LANG": language, "PYTHONUTF8": "1"},
    )


def main() -> int:
    """Run all checks and print the failures; return 1 if there are any."""
    with nep.master("127.0.0.1:0", learn_s=0.0) as master:
        faults = [
            *check_installation(),
            *check_imports(),
            *check_messages(None),
            *check_messages(master.address),
            *check_services(master.address),
            *check_missing_extras(master.address),
            *check_command_line(master.address),
        ]
    faults += [f"{name} was loaded" for name in ABSENT if name in sys.modules]
    for fault in faults:
        print(f"library alone: {fault}", file=sys.stderr)
    if not faults:
        version = "{}.{}.{}".format(*sys.version_info[:3])
        print(f"· nep {nep.__version__} on Python {version}: messages, services and commands work")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
