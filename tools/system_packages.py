"""System packages that Studio needs on Debian and Ubuntu: find and install missing ones.

Run alone with `sudo python3 -B -m tools.system_packages`; dev.py installs them automatically when run as
root.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from tools.computer import ROOT, CommandError, Computer, timed

# Names differ between releases of Debian and Ubuntu: the first available one is installed.
QT_LIBRARIES = (
    "libgl1",
    "libegl1",
    "libxkbcommon0",
    "libdbus-1-3",
    "libfontconfig1",
    "libglib2.0-0t64|libglib2.0-0",
    "libnss3",
    "libnspr4",
    "libasound2t64|libasound2",
    "libxcomposite1",
    "libxdamage1",
    "libxrandr2",
    "libxtst6",
    "libxkbfile1",
    "libxcb-cursor0",
    "libxcb-icccm4",
    "libxcb-keysyms1",
    "libxcb-image0",
    "libxcb-render-util0",
    "libxcb-shape0",
    "libxcb-xkb1",
    "libxcb-randr0",
    "libxcb-sync1",
    "libxcb-xfixes0",
    "libxkbcommon-x11-0",
    "libx11-xcb1",
)


TEST_PACKAGES = {
    "the C# client": ("mono-mcs", "mono-runtime", "libnewtonsoft-json5.0-cil"),
    "ROS 1": (
        "python3-rospy",
        "python3-rosmaster",
        "python3-std-msgs",
        "python3-std-srvs",
        "python3-sensor-msgs",
        "python3-geometry-msgs",
    ),
    "nanocat": ("nanomsg-utils",),
}
"""Packages that some tests need, by subject. If they are missing, the tests are skipped."""


def required_packages(computer: Computer) -> list[str]:
    """Return the required packages; ``a|b`` stands for a package with different names in some releases."""
    packages = list(QT_LIBRARIES)
    if not computer.has_screen:
        packages.append("xvfb")
    if not computer.has_ensurepip:
        packages.append("python{}.{}-venv".format(*computer.version))
    return packages


def missing_packages(computer: Computer) -> list[str]:
    """Return the entries of `required_packages` that are not installed under any of their names."""
    required = required_packages(computer)
    names = [name for entry in required for name in entry.split("|")]
    lines = computer.ask(["dpkg-query", "-W", "-f", "${Package} ${db:Status-Status}\n", *names]).splitlines()
    installed = {line.split()[0] for line in lines if line.endswith(" installed")}
    return [entry for entry in required if installed.isdisjoint(entry.split("|"))]


def available(computer: Computer, entries: Sequence[str]) -> tuple[list[str], list[str]]:
    """Look up packages in apt's package lists.

    Args:
        computer: Computer to run on.
        entries: Entries in the format of `required_packages`.

    Returns:
        The first available name of each entry, and the entries that apt doesn't know.
    """
    names = [name for entry in entries for name in entry.split("|")]
    installable: set[str] = set()
    name = ""
    for line in computer.ask(["apt-cache", "policy", *names]).splitlines():
        if line and not line.startswith(" "):
            name = line.rstrip(":").split(":")[0]
        elif line.strip().startswith("Candidate:") and "(none)" not in line:
            installable.add(name)
    available_names = [
        next((name for name in entry.split("|") if name in installable), "") for entry in entries
    ]
    unknown = [entry for entry, name in zip(entries, available_names, strict=True) if not name]
    return [name for name in available_names if name], unknown


def install_system_packages(computer: Computer) -> None:
    """Install missing packages if run as root; otherwise raise `CommandError` with the command for it."""
    if not computer.has_apt:
        return
    missing = missing_packages(computer)
    if not missing:
        return
    names, unknown = available(computer, missing)
    if not computer.root:
        line = " ".join(sorted([*names, *(entry.split("|")[-1] for entry in unknown)]))
        raise CommandError(
            "system libraries are missing; install them with this command, then run dev.py again:\n"
            f"  sudo apt-get update && sudo apt-get install -y --no-install-recommends {line}"
        )
    with timed(f"installing {len(missing)} system packages with apt (downloads about 70 MB the first time)"):
        apt_install(computer, missing, names, unknown)


def install_test_packages(computer: Computer) -> None:
    """Install missing `TEST_PACKAGES` if run as root.

    Otherwise, and if apt fails, print which tests are skipped, and the command or the reason.
    """
    if not computer.has_apt:
        return
    names = [name for packages in TEST_PACKAGES.values() for name in packages]
    lines = computer.ask(["dpkg-query", "-W", "-f", "${Package} ${db:Status-Status}\n", *names]).splitlines()
    for tested, packages in TEST_PACKAGES.items():
        missing = [name for name in packages if f"{name} installed" not in lines]
        if not missing:
            continue
        try:
            if not computer.root:
                raise CommandError(f"sudo apt-get install -y --no-install-recommends {' '.join(missing)}")
            with timed(f"installing {len(missing)} packages with apt, for tests of {tested}"):
                apt_install(computer, missing, *available(computer, missing))
        except CommandError as error:
            print(f"· tests of {tested} will be skipped: {error}")


def apt_install(computer: Computer, missing: Sequence[str], names: list[str], unknown: list[str]) -> None:
    """Install packages with apt. Must run as root.

    The package lists are updated if a package is unknown or the installation fails.

    Args:
        computer: Computer to run on.
        missing: Missing entries in the format of `required_packages`.
        names: Available names of the entries, from `available`.
        unknown: Entries that apt doesn't know, from `available`.

    Raises:
        CommandError: The installation failed; the message contains the last lines of apt's output.
    """
    log = ROOT / "build" / "apt.log"
    log.parent.mkdir(exist_ok=True)
    log.unlink(missing_ok=True)
    environ = {**computer.environ, "DEBIAN_FRONTEND": "noninteractive"}
    apt = ["apt-get", "-q", "-o", "DPkg::Lock::Timeout=600", "-o", "Dpkg::Use-Pty=0"]
    install = [*apt, "install", "-y", "--no-install-recommends"]
    if not unknown and computer.do([*install, *names], environ, log) == 0:
        return
    # The package lists may be missing or outdated.
    computer.do([*apt, "update"], environ, log)
    names, unknown = available(computer, missing)
    if unknown:
        raise CommandError(
            f"apt has no package for {', '.join(unknown)}; check its package sources (log: '{log}')"
        )
    if computer.do([*install, *names], environ, log) != 0:
        log_tail = "".join(log.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)[-12:])
        raise CommandError(f"apt could not install the system libraries; end of '{log}':\n{log_tail}")


def main(computer: Computer | None = None) -> int:
    """Install missing packages; return 2 with a message if that is impossible."""
    try:
        install_system_packages(computer or Computer())
    except CommandError as error:
        print(f"system packages: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
