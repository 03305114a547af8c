"""Derivation of findings from facts. Performs no I/O and reads no clock."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal

from nep.i18n import _
from nep.programs.doctor.facts import Facts, FolderFact, PackageFact
from nep.programs.doctor.finding import Finding, Severity
from nep.programs.doctor.network import (
    alert_findings,
    loopback_findings,
    master_findings,
    original_program_findings,
    remote_clock_findings,
)
from nep.programs.doctor.original_ports import port_findings

MIN_FILES = 1024
FILES_WARNING_RATIO = 0.8
_FILES_PER_TOPIC = 20
"""File descriptors that a master needs per topic of the original NEP; a native topic needs fewer."""
_SEVERITY_ORDER: dict[Severity, int] = {"error": 0, "warning": 1, "info": 2, "ok": 3}
_SEVERITY_SIGNS = {"error": "x", "warning": "!", "info": "-", "ok": "+"}
MIN_VALID_TIME_S = 1_704_067_200.0
"""Start of 2024 (s since 1970). A clock with an earlier time counts as never set."""


def findings(facts: Facts) -> tuple[Finding, ...]:
    """Derive all findings from the facts, worst first."""
    return sort_findings(finding for check in CHECKS.values() for finding in check(facts))


def sort_findings(unsorted: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort findings by severity, worst first; the order is stable."""
    return tuple(sorted(unsorted, key=lambda finding: _SEVERITY_ORDER[finding.severity]))


def exit_code(results: Sequence[Finding]) -> Literal[0, 1, 2]:
    """Return the exit code of `nep doctor`: 2 if there is an error, 1 if there is a warning, else 0."""
    severities = {finding.severity for finding in results}
    return 2 if "error" in severities else 1 if "warning" in severities else 0


def report_text(results: Sequence[Finding]) -> str:
    """Format findings as plain text, for a bug report."""
    lines = []
    for finding in results:
        lines.append(f"{_SEVERITY_SIGNS[finding.severity]} {finding.sentence}")
        lines += [f"    {line}" for line in (finding.fix, finding.command) if line]
    return "\n".join(lines) + "\n"


def to_plain(results: Sequence[Finding]) -> list[dict[str, object]]:
    """Convert findings to JSON-serializable dicts, for `--json`."""
    return [asdict(finding) for finding in results]


def _package_findings(facts: Facts) -> Iterator[Finding]:
    originals = [package for package in facts.packages if package.name.lower() == "nep"]
    for package in originals:
        yield Finding(
            "package:nep",
            "error",
            _(
                "The original package nep {version} is installed together with NEP Studio; both packages "
                "are named “nep”."
            ).format(version=package.version),
            _(
                "Uninstall the original package and reinstall NEP Studio. Use a separate Python environment "
                "for programs of the original NEP."
            ),
            command="pip uninstall -y nep && pip install --force-reinstall --no-deps nep-studio",
        )
    if facts.original_files and not originals:
        yield Finding(
            "package:files",
            "error",
            _("The folder {folder} contains files of the original NEP: {names}.").format(
                folder=facts.nep_folder, names=", ".join(facts.original_files)
            ),
            _("Reinstall NEP Studio."),
            command="pip install --force-reinstall --no-deps nep-studio",
        )
    if facts.shadowing_file:
        yield Finding(
            "package:shadow",
            "warning",
            _("{file} hides the package “nep” from programs that start in this folder.").format(
                file=facts.shadowing_file
            ),
            _("Rename that file."),
        )
    if not originals and not facts.original_files:
        yield Finding(
            "package", "ok", _("“import nep” uses the package in {folder}.").format(folder=facts.nep_folder)
        )
    yield from _python_namesake_findings(facts)
    if facts.node_packages:
        yield _node_package_finding(facts.node_packages)


def _python_namesake_findings(facts: Facts) -> Iterator[Finding]:
    if facts.path_package is not None:
        yield Finding(
            "package:python3",
            "info",
            _("“python3” in the terminal imports the original nep {version} from {folder}.").format(
                version=facts.path_package.version, folder=facts.path_package.location
            ),
            _(
                "Programs of the original NEP need this package and connect through the gateway. Start "
                "other programs with the Python of NEP Studio."
            ),
        )


def _node_package_finding(packages: Sequence[PackageFact]) -> Finding:
    imported_package, *hidden_packages = packages
    own_package = next((each for each in hidden_packages if each.is_ours), None)
    if imported_package.is_ours:
        return Finding(
            "package:nep-js",
            "ok",
            _(
                "JavaScript programs in this folder import nep-js {version} of NEP Studio from {folder}."
            ).format(version=imported_package.version, folder=imported_package.location),
        )
    if own_package is not None:
        return Finding(
            "package:nep-js",
            "warning",
            _(
                "JavaScript programs in this folder import another project's nep-js {version} from "
                "{folder} instead of NEP Studio's in {hidden}."
            ).format(
                version=imported_package.version,
                folder=imported_package.location,
                hidden=own_package.location,
            ),
            _("Uninstall the other package, or keep programs of the original NEP in a separate folder."),
            command=f'npm uninstall --prefix "{Path(imported_package.location).parent.parent}" nep-js',
        )
    return Finding(
        "package:nep-js",
        "info",
        _(
            "JavaScript programs in this folder import nep-js {version} from {folder}, which isn't "
            "part of NEP Studio."
        ).format(version=imported_package.version, folder=imported_package.location),
        _(
            "Programs of the original NEP connect through the gateway. For other programs, install the file "
            "nep-js-….tgz of NEP Studio's release in this folder."
        ),
    )


def _file_findings(facts: Facts) -> Iterator[Finding]:
    files = facts.files
    if files.soft_limit is not None and files.soft_limit < MIN_FILES:
        yield Finding(
            "files",
            "warning",
            _("The open-file limit is {files}, enough for about {topics} topics.").format(
                files=files.soft_limit, topics=files.soft_limit // _FILES_PER_TOPIC
            ),
            _("Raise the limit in the terminal from which you start programs."),
            command=f"ulimit -n {min(8192, files.hard_limit or 8192)}",
        )
    elif files.soft_limit is not None:
        yield Finding("files", "ok", _("Open-file limit: {files}.").format(files=files.soft_limit))
    open_count, limit = files.master_open_count, files.master_limit
    if open_count is not None and limit is not None and open_count > FILES_WARNING_RATIO * limit:
        yield Finding(
            "files:master",
            "warning",
            _(
                "The master has {opened} of at most {limit} files open. At the limit, no more programs can "
                "connect."
            ).format(opened=open_count, limit=limit),
            _("Stop the master and start it from a terminal with a higher limit."),
            command="ulimit -n 8192 && nep master",
        )


def _program_findings(facts: Facts) -> Iterator[Finding]:
    for program in facts.programs:
        if program.open_count > FILES_WARNING_RATIO * program.limit:
            yield Finding(
                f"files:{program.pid}",
                "warning",
                _(
                    "The program of “{name}” has {opened} of at most {limit} files open. At the limit, it "
                    "can't create publishers or subscribers, and other programs can't connect to it."
                ).format(name=program.name, opened=program.open_count, limit=program.limit),
                _(
                    "Close nodes and files that the program no longer needs, or start it from a terminal "
                    "with a higher limit."
                ),
                command="ulimit -n 8192",
            )


def _folder_findings(facts: Facts) -> Iterator[Finding]:
    for folder in facts.folders:
        if folder.problem:
            yield _unwritable_folder_finding(folder)
        else:
            yield Finding(
                f"folder:{folder.path}",
                "ok",
                _("{purpose} can be saved in {path}.").format(purpose=folder.purpose, path=folder.path),
            )


def _unwritable_folder_finding(folder: FolderFact) -> Finding:
    return Finding(
        f"folder:{folder.path}",
        "error",
        _("{purpose} can't be saved in {path}: {problem}.").format(
            purpose=folder.purpose, path=folder.path, problem=folder.problem
        ),
        _("Check that you own the folder and can write to it, and that the disk has free space."),
    )


def _clock_findings(facts: Facts) -> Iterator[Finding]:
    if facts.now_s < MIN_VALID_TIME_S:
        yield Finding(
            "clock",
            "warning",
            _("The clock of this computer is wrong: it shows a date before 2024."),
            _("Set the clock: message ages depend on it."),
        )


def _version_findings(facts: Facts) -> Iterator[Finding]:
    text = ", ".join(f"{name} {version}" for name, version in facts.versions.items())
    yield Finding("versions", "info", f"{text}.")


CHECKS: Mapping[str, Callable[[Facts], Iterator[Finding]]] = {
    "loopback": loopback_findings,
    "masters": master_findings,
    "ports": port_findings,
    "packages": _package_findings,
    "originals": original_program_findings,
    "alerts": alert_findings,
    "files": _file_findings,
    "programs": _program_findings,
    "folders": _folder_findings,
    "clocks": remote_clock_findings,
    "clock": _clock_findings,
    "versions": _version_findings,
}
"""Checks by name, in the order in which findings of equal severity are shown."""
