from __future__ import annotations

import pytest

from nep.programs.gateway.portmap import FIRST_PORT, LAST_PORT, PortMap, Registration, TopicLine, default_file

JSON_A = TopicLine("t", "prefixed", "json", "many2many")
JSON_B = TopicLine("t", "bare", "json", "many2many")


def registration(line=JSON_A, node="n", pid=7):
    return Registration(line, node, "publisher", "json", "A", None, pid, 12.5)


def test_port_map_persists_after_a_restart(tmp_path):
    before = PortMap(tmp_path / "deep" / "map.json")
    before.assign(JSON_A, 9000)
    before.assign(JSON_B, 9002)
    before.add(registration())
    before.save()
    after = PortMap(tmp_path / "deep" / "map.json")
    assert dict(after.base_ports) == {JSON_A: 9000, JSON_B: 9002}
    assert after.registrations == (registration(),)
    assert [entry.name for entry in (tmp_path / "deep").iterdir()] == ["map.json"]


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", '{"version":99}', '{"version":1,"lines":[{}],"programs":[]}', '{"version":1,"lines":7}'],
)
def test_damaged_port_map_file_gives_an_empty_map(tmp_path, text):
    file = tmp_path / "map.json"
    file.write_text(text)
    assert not PortMap(file).base_ports


def test_repeated_registration_is_stored_once_and_other_programs_separately():
    known = PortMap(None)
    known.add(registration())
    known.add(registration())
    known.add(registration(pid=8))
    assert len(known.registrations) == 2
    known.remove({registration(pid=8)})
    assert known.registrations == (registration(),)


def test_registrations_are_discarded_and_ports_kept_after_a_reboot(tmp_path):
    before = PortMap(tmp_path / "map.json", boot_time_s=1000.0)
    before.assign(JSON_A, 9000)
    before.add(registration())
    before.save()
    after = PortMap(tmp_path / "map.json", boot_time_s=5000.0)
    assert after.port_of(JSON_A) == 9000
    assert not after.registrations


def test_ports_are_assigned_from_9000_in_even_steps():
    known = PortMap(None)
    assert next(known.candidates(lambda line: True)) == FIRST_PORT == 9000
    known.assign(JSON_A, 9000)
    assert next(known.candidates(lambda line: True)) == 9002


def test_port_of_an_unused_topic_line_is_reassigned_only_when_all_ports_are_assigned():
    known = PortMap(None)
    for number, port in enumerate(range(FIRST_PORT, LAST_PORT + 1, 2)):
        known.assign(TopicLine(f"t{number}", "bare", "json", "many2many"), port)
    assert list(known.candidates(lambda line: line.topic != "t3")) == [9006]
    known.assign(JSON_A, 9006)
    assert known.port_of(JSON_A) == 9006
    assert known.port_of(TopicLine("t3", "bare", "json", "many2many")) is None
    assert not list(known.candidates(lambda line: True))


def test_nodes_of_the_same_name_have_different_ids():
    assert registration(pid=1).node_id != registration(pid=2).node_id
    assert registration(pid=None).node_id == registration(pid=None).node_id


def test_each_master_port_has_its_own_port_map_file(tmp_path, monkeypatch):
    monkeypatch.setenv("NEP_STATE_DIR", str(tmp_path))
    assert default_file(7780) != default_file(7781)
    assert default_file(7780).parent == tmp_path
