"""Tests of the findings that the doctor derives from constructed facts."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from nep.programs.doctor import Facts, exit_code, findings, report_text, to_plain
from nep.programs.doctor.facts import (
    ClockFact,
    FileFact,
    FolderFact,
    PackageFact,
    PortFact,
    ProcessFact,
    ProgramFact,
)
from nep.programs.doctor.installs import Install
from nep.protocol.graph_view import Alert, GraphView, NodeInfo

NOW = 1_800_000_000.0
MASTER = ProcessFact(41, "nep", is_master=True, started_s=NOW - 7200)
OTHER = ProcessFact(77, "python3 server.py", started_s=NOW - 5)


def node(name, generation="native"):
    return NodeInfo(name, name, "lab", 1, "Python", generation, 0)


def view(*nodes, alerts=(), topics=None):
    return GraphView(1, 1, {each.id: each for each in nodes}, topics or {}, tuple(alerts))


HEALTHY = Facts(
    NOW,
    "127.0.0.1:7780",
    "linux",
    {"Python": "3.11.7", "pyzmq": "27.3.0"},
    "/somewhere/nep",
    view(node("Pepper"), node("studio")),
    0.004,
    PortFact(7780, "the master's", True, MASTER),
    (
        PortFact(7000, "where old programs ask", True, MASTER),
        PortFact(50000, "where newer ones ask", True, MASTER),
        PortFact(12345, "where nodes are told to end", False),
    ),
    ((MASTER, 7780),),
    packages=(PackageFact("nep-studio", "0.1.0", "/somewhere"),),
    files=FileFact(20_000, 20_000, 60, 8192),
    folders=(FolderFact("/state", "Settings"),),
)


def found(severity=None, **changes):
    """Return the findings for healthy facts with these changes, by id; with `severity`, only those."""
    made = findings(replace(HEALTHY, **changes))
    return {each.id: each for each in made if severity is None or each.severity == severity}


def test_healthy_computer_has_no_warning():
    made = findings(HEALTHY)
    assert exit_code(made) == 0
    assert found()["master"].sentence == (
        "A master has been running at 127.0.0.1:7780 (process 41) for 2.0 h: 2 nodes, 0 topics."
    )
    assert found()["ports"].sentence == (
        "The master uses ports 7000 and 50000, which programs of the original NEP connect to."
    )


def test_master_of_another_version_is_reported_with_a_fix():
    versions = {"NEP Studio": "0.2.0"}
    older = Install("0.1.0", NOW - 90_000, "/opt/old")
    one = found(versions=versions, master_install=older)["master:version"]
    assert one.sentence == (
        "The master at 127.0.0.1:7780 (process 41) belongs to NEP Studio 0.1.0 (/opt/old); this is "
        "0.2.0. New features and fixes may not work with it."
    )
    assert (one.severity, one.command) == ("warning", "kill 41")
    assert one.fix.startswith("Stop that master. If Studio is open, it starts a new one")
    there = found(versions=versions, master_install=older, platform="win32")["master:version"]
    assert there.command == "taskkill /F /PID 41"


def test_master_started_before_the_installation_is_reported():
    versions = {"NEP Studio": "0.2.0"}
    one = found(versions=versions, master_install=Install("0.2.0", NOW - 60, "/here"))["master:version"]
    assert "was started before NEP Studio 0.2.0 was installed" in one.sentence
    same = Install("0.2.0", NOW - 90_000, "/here")
    assert "master:version" not in found(versions=versions, master_install=same)


@pytest.mark.parametrize("changes", [{}, {"versions": {"NEP Studio": "(not installed)"}}, {"view": None}])
def test_unknown_version_is_not_reported(changes):
    known = {"versions": {"NEP Studio": "0.2.0"}, "master_install": Install("0.1.0", NOW, "/opt/old")}
    known = known | changes if changes else {"versions": {"NEP Studio": "0.2.0"}}
    assert "master:version" not in found(**known)


def test_missing_master_is_reported_with_the_start_command():
    one = found(view=None, master_port=PortFact(7780, "", False))["master:none"]
    assert (one.severity, one.command) == ("error", "nep master")
    other = found(view=None, address="127.0.0.1:9", master_port=PortFact(9, "", False))["master:none"]
    assert other.command == "nep master --port 9"


def test_no_start_command_is_suggested_for_a_network_address():
    made = found(view=None, address="10.0.0.5:7780", master_port=PortFact(7780, "", False))
    assert made["master:network"].command == ""
    assert "127.0.0.1:7780" in made["master:network"].fix
    assert "master:none" not in made


@pytest.mark.parametrize(
    ("reach", "sentence", "fix"),
    [
        (
            "timeout",
            "10.0.0.5:7780 doesn't respond, so the master can't be reached.",
            "10.0.0.5 is off",
        ),
        (
            "refused",
            "10.0.0.5 can be reached, but accepts no connections from other computers on port 7780.",
            "allow other computers to connect",
        ),
        ("unknown", "This computer has no route to 10.0.0.5:7780", "on the same network"),
        ("", "10.0.0.5 responds on port 7780, but the master doesn't.", "another program uses that port"),
    ],
)
def test_unreachable_remote_master_is_reported_with_the_kind_of_failure(reach, sentence, fix):
    made = found(view=None, address="10.0.0.5:7780", master_port=None, reach_failure=reach)
    one = made["master:unreached"]
    assert (one.severity, one.command) == ("error", "")  # a remote master can't be started from here
    assert one.sentence.startswith(sentence)
    assert fix in one.fix
    assert "master:none" not in made


def test_no_start_command_is_suggested_for_an_unknown_host():
    made = found(view=None, address="lap.top:7780", master_port=None, is_host_known=False)
    assert (
        made["master:unknown"].sentence
        == "Can't find a computer named “lap.top”, so the master can't be reached."
    )
    assert "Check the spelling" in made["master:unknown"].fix
    assert "master:none" not in made


def test_foreign_program_on_the_master_port_is_named_with_a_workaround():
    one = found(view=None, master_port=PortFact(7780, "", True, OTHER))["master:foreign"]
    assert one.sentence == "“python3 server.py” (process 77) uses port 7780 but isn't a master."
    assert "7781" in one.fix
    assert one.command == "nep master --port 7781"
    unknown = found(view=None, master_port=PortFact(7780, "", True))["master:foreign"]
    assert "unknown program uses port 7780" in unknown.sentence


def test_hung_or_slow_master_is_reported():
    hung = found(view=None, master_port=PortFact(7780, "", True, MASTER))["master:hung"]
    assert hung.command == "kill 41"
    windows = found(view=None, master_port=PortFact(7780, "", True, MASTER), platform="win32")["master:hung"]
    assert windows.command == "taskkill /F /PID 41"
    assert found(reply_time_s=0.8)["master:slow"].severity == "warning"


def test_two_masters_are_reported_with_their_ports():
    second = ProcessFact(50, "nep", is_master=True)
    one = found(masters=((MASTER, 7780), (second, None)))["master:several"]
    assert "port 7780 (process 41), process 50" in one.sentence


def originals_ports(*holders, numbers=(7000, 50000, 7777)):
    return tuple(PortFact(n, "where some ask", True, each) for n, each in zip(numbers, holders, strict=True))


def about_ports(**changes):
    return {id: each for id, each in found(**changes).items() if id.startswith("port")}


def test_taken_gateway_ports_are_one_warning_that_names_the_programs():
    made = about_ports(ports=originals_ports(OTHER, OTHER, OTHER))
    assert list(made) == ["ports:taken"]
    one = made["ports:taken"]
    assert one.severity == "warning"
    assert "Ports 7000, 50000 and 7777" in one.sentence
    assert one.sentence.count("“python3 server.py” (process 77)") == 1
    several = about_ports(ports=originals_ports(OTHER, None, ProcessFact(9, "redis")))["ports:taken"]
    assert re.search(
        r"7000 .*“python3 server\.py” \(process 77\).*50000 .*another program.*7777 .*“redis” \(process 9\)",
        several.sentence,
    )
    single = about_ports(ports=originals_ports(OTHER, numbers=(50000,)))["ports:taken"]
    assert single.sentence == "Port 50000, where some ask, is in use by “python3 server.py” (process 77)."


def test_gateway_port_held_by_another_master_is_reported():
    second = ProcessFact(50, "python3 nep", is_master=True)
    made = about_ports(ports=originals_ports(second, MASTER, numbers=(7000, 50000)))
    assert "another master (process 50)" in made["ports:taken"].sentence
    assert "port 50000," in made["ports"].sentence


@pytest.mark.parametrize("gateway", [True, False])
def test_port_of_an_unknown_process_is_attributed_to_the_master_unless_an_alert_exists(gateway):
    nodes = [node("gateway", "gateway")] if gateway else []
    told = view(*nodes, alerts=[Alert("port:50000", "taken")])
    made = about_ports(view=told, ports=originals_ports(None, None, numbers=(7000, 50000)))
    taken = made["ports:taken"].sentence
    assert "another program" in taken
    assert ("Port 50000" in taken, "ports" in made) == (gateway, gateway)


@pytest.mark.parametrize(
    "holder", [None, ProcessFact(3, "ControlCenter"), ProcessFact(3, "AirPlayXPCHelper")]
)
def test_airplay_is_named_on_macos(holder):
    made = found(platform="darwin", ports=(PortFact(7000, "where old programs ask", True, holder),))
    assert "AirPlay Receiver" in made["ports:airplay"].sentence
    assert "AirDrop & Handoff" in made["ports:airplay"].fix


def test_program_other_than_airplay_on_port_7000_of_a_mac_is_named():
    made = found(platform="darwin", ports=(PortFact(7000, "", True, OTHER),))
    assert "python3 server.py" in made["ports:taken"].sentence


def test_disabled_gateway_is_not_a_warning():
    one = found(ports=(PortFact(7000, "where old programs ask", False),))["ports:free"]
    assert (one.severity, one.fix) == ("info", "The master was started without its gateway.")
    assert list(about_ports(is_gateway_enabled=False)) == ["ports"]


def test_kill_channel_is_reported_as_information_only():
    assert found(ports=(PortFact(12345, "", True, OTHER),))["port:12345"].severity == "info"


def test_original_package_its_leftover_files_and_shadowing_files_are_reported():
    one = found(packages=(PackageFact("nep", "0.5.4.8", "/somewhere"),))["package:nep"]
    assert one.severity == "error"
    assert "nep 0.5.4.8" in one.sentence
    assert one.command.startswith("pip uninstall -y nep")
    assert "package" not in found(packages=(PackageFact("nep", "0.5.4.8", "/somewhere"),))
    both = found(packages=(PackageFact("nep", "0.5.4.8", "/somewhere"),), original_files=("publisher.py",))
    assert "package:files" not in both, "the first fix cures both"
    left = found(original_files=("publisher.py", "master.py"))["package:files"]
    assert "publisher.py, master.py" in left.sentence
    assert found(shadowing_file="/home/me/nep.py")["package:shadow"].severity == "warning"


OUR_JS = PackageFact("nep-js", "0.2.0", "/home/me/node_modules/nep-js")
OTHER_JS = PackageFact("nep-js", "0.1.1", "/home/me/robot/node_modules/nep-js", is_ours=False)


@pytest.mark.parametrize(
    ("packages", "severity", "command"),
    [
        ((OUR_JS, OTHER_JS), "ok", ""),
        ((OTHER_JS,), "info", ""),
        ((OTHER_JS, OUR_JS), "warning", f'npm uninstall --prefix "{Path("/home/me/robot")}" nep-js'),
    ],
)
def test_foreign_nep_js_package_is_a_warning_only_if_it_shadows_nep_js(packages, severity, command):
    one = found(node_packages=packages)["package:nep-js"]
    assert (one.severity, one.command) == (severity, command)
    assert packages[0].location in one.sentence
    assert "package:nep-js" not in found()


def test_original_package_in_the_python_of_the_terminal_is_reported():
    original = PackageFact("nep", "0.5.4.8", "/usr/lib/python3/dist-packages", is_ours=False)
    one = found(path_package=original)["package:python3"]
    assert one.severity == "info"
    assert "0.5.4.8" in one.sentence
    assert "/usr/lib/python3/dist-packages" in one.sentence


def test_low_open_file_limit_is_reported_with_the_number_of_topics_it_allows():
    one = found(files=FileFact(256, 10_240))["files"]
    assert one.severity == "warning"
    assert "12 topics" in one.sentence
    assert one.command == "ulimit -n 8192"
    assert found(files=FileFact(256, 512))["files"].command == "ulimit -n 512"
    assert found(files=FileFact(8192, 8192, 8000, 8192))["files:master"].severity == "warning"
    assert "files" not in found(files=FileFact(None, None))


def test_program_near_its_open_file_limit_is_reported():
    made = found(programs=(ProgramFact(7, "Pepper", 250, 256), ProgramFact(8, "Rover", 90, 256)))
    assert "“Pepper” has 250 of at most 256 files open" in made["files:7"].sentence
    assert (made["files:7"].severity, made["files:7"].command) == ("warning", "ulimit -n 8192")
    assert "files:8" not in made


def test_originals_are_named_and_unsupported_versions_are_errors():
    made = found(
        view=view(node("rize", "A"), node("camera", "B"), node("bad", "0.5.4.7"), node("g", "gateway"))
    )
    assert made["originals"].sentence == (
        "2 programs of the original NEP: rize (up to 0.5.4.5), camera (0.5.4.8)."
    )
    assert made["original:bad"].severity == "error"
    assert "0.5.4.7" in made["original:bad"].sentence
    assert "0.5.4.8 or 0.5.4.5" in made["original:bad"].fix


def test_alerts_of_the_master_are_findings_except_those_the_doctor_checks_itself():
    alerts = [
        Alert("name:x", "2 programs are named “x”", "Give each a name."),
        Alert("port:7000", "taken"),
    ]
    made = found(view=view(alerts=alerts))
    assert made["name:x"].fix == "Give each a name."
    assert "port:7000" not in made  # the doctor checks the port itself


def test_folder_clock_and_loopback_problems_are_reported():
    assert found(folders=(FolderFact("/state", "Settings", "permission denied"),))[
        "folder:/state"
    ].sentence == ("Settings can't be saved in /state: permission denied.")
    assert "3.2 s ahead" in found(clocks=(ClockFact("lab", 3.21),))["clock:lab"].sentence
    assert found(now_s=1000.0)["clock"].severity == "warning"
    one = found(loopback_problem="network is unreachable")["loopback"]
    assert (one.severity, one.command) == ("error", "ip link set lo up")


def test_findings_are_sorted_by_severity_and_the_worst_sets_the_exit_code():
    made = findings(replace(HEALTHY, view=None, master_port=PortFact(7780, "", False), shadowing_file="x"))
    assert [each.severity for each in made][:2] == ["error", "warning"]
    assert exit_code(made) == 2


def test_report_is_plain_text_with_fixes():
    made = findings(replace(HEALTHY, view=None, master_port=PortFact(7780, "", False)))
    lines = report_text(made).splitlines()
    assert lines[:3] == [
        "x No master is running at 127.0.0.1:7780, so new programs can't find each other.",
        "    Start a master.",
        "    nep master",
    ]
    assert to_plain(made)[0]["id"] == "master:none"


def test_findings_are_complete_sentences():
    for each in (*findings(HEALTHY), *found(view=None, master_port=None, shadowing_file="/x").values()):
        assert each.sentence.endswith(".")
        assert each.sentence[0].isupper() or each.sentence[0] in "“/"
