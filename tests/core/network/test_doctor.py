"""Tests of the doctor in its background thread: one run at a time, and failures are reported."""

from __future__ import annotations

import socket
import threading

from app.core.network.doctor import Doctor, create_doctor
from nep.programs.doctor import Finding, ProgressCallback

FINE = Finding("master", "ok", "A master runs.")


def test_doctor_runs_in_background_and_keeps_its_findings() -> None:
    go_on = threading.Event()
    looks = []

    def look(_topic: str, _tell: object) -> list[Finding]:
        looks.append(threading.current_thread().name)
        go_on.wait(60)
        return [FINE]

    doctor = Doctor(look, lambda: 7.0)
    assert (doctor.is_running, doctor.finished_s, doctor.findings) == (False, None, ())
    doctor.start()
    doctor.start()  # already running
    assert doctor.is_running
    go_on.set()
    doctor.close()
    assert looks == ["studio-doctor"]
    assert (doctor.is_running, doctor.finished_s, doctor.findings) == (False, 7.0, (FINE,))
    assert doctor.revision == 2


def test_partial_findings_are_available_while_doctor_runs() -> None:
    went, go_on = threading.Event(), threading.Event()

    def look(_topic: str, tell: ProgressCallback) -> list[Finding]:
        tell((FINE,), 1, 3)
        went.set()
        go_on.wait(30)
        return [FINE, FINE, FINE]

    doctor = Doctor(look)
    assert doctor.partial_findings is None
    doctor.start()
    assert went.wait(30)
    assert (doctor.partial_findings, doctor.check_count, doctor.total_checks) == ((FINE,), 1, 3)
    assert (doctor.finished_s, doctor.findings) == (None, ())
    go_on.set()
    doctor.close()
    assert (doctor.partial_findings, len(doctor.findings)) == (None, 3)


def test_topic_requested_during_a_run_is_checked_next() -> None:
    began, go_on = threading.Event(), threading.Event()
    asked = []

    def look(topic: str, _tell: object) -> list[Finding]:
        asked.append(topic)
        began.set()
        go_on.wait(30)
        return [Finding("topic", "ok", topic)]

    doctor = Doctor(look)
    doctor.expect_topic("/a")
    assert began.wait(30)
    doctor.expect_topic("/b")
    assert (doctor.expected_topic, doctor.checked_topic) == ("/b", "")
    go_on.set()
    doctor.close()
    assert asked == ["/a", "/b"]
    assert (doctor.checked_topic, doctor.findings[0].sentence) == ("/b", "/b")


def test_topics_of_other_networks_are_not_checked(tmp_path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    doctor = create_doctor(address, tmp_path)
    doctor.expect_topic("ros2 /camera")
    doctor.close()
    assert not any(finding.id.startswith("topic") for finding in doctor.findings)


def test_failed_doctor_run_is_reported_as_finding() -> None:
    def look(_topic: str, _tell: object) -> list[Finding]:
        raise ValueError("no such luck")

    doctor = Doctor(look)
    doctor.start()
    doctor.close()
    assert doctor.findings[0].severity == "error"
    assert "ValueError: no such luck" in doctor.findings[0].sentence


def test_doctor_checks_studio_folder(tmp_path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    doctor = create_doctor(address, tmp_path)
    doctor.start()
    doctor.close()
    found = {finding.id: finding for finding in doctor.findings}
    assert found["master:none"].severity == "error"
    assert found[f"folder:{tmp_path}"].severity == "ok"
