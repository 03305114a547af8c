"""Tests of allowing connections from other computers from the window."""

from __future__ import annotations

import threading

import pytest

from app.core.alerts.alerts import Alerts
from app.core.network.remote_access import ALERT, RemoteAccess
from app.core.storage.settings import Settings
from app.intents import AllowOtherComputers
from nep.errors import RequestRefusedError
from nep.protocol.graph_view import GraphView
from nep.system.addresses import OwnAddress


class World:
    """Fake master that accepts or rejects requests, and the events posted to the window."""

    def __init__(self):
        self.asked = []
        self.refusal = ""
        self.posted = []
        self.came = threading.Event()

    def ask(self, hosts, address):
        self.asked.append((tuple(hosts), address))
        if self.refusal:
            raise RequestRefusedError(self.refusal)

    def post(self, event):
        self.posted.append(event)
        self.came.set()

    def answer(self, reach):
        assert self.came.wait(60.0)
        self.came.clear()
        reach.on_changed(self.posted.pop())


@pytest.fixture
def world():
    return World()


@pytest.fixture
def make(world, tmp_path):
    def make(address="127.0.0.1:7780"):
        here = (OwnAddress("192.168.1.20", "wlan0"),)
        alerts = Alerts()
        reach = RemoteAccess(
            address,
            Settings(tmp_path),
            alerts,
            world.post,
            request_listen=world.ask,
            local_addresses=lambda: here,
        )
        return reach, alerts

    return make


def test_user_can_allow_and_deny_connections_from_other_computers(world, make):
    reach, alerts = make()
    assert reach.environment_variable("192.168.1.20") == "NEP_MASTER=192.168.1.20:7780"
    reach.listen_on(["192.168.1.20"])
    world.answer(reach)
    assert world.asked == [(("192.168.1.20",), "127.0.0.1:7780")]
    assert reach.hosts == ("192.168.1.20",)
    reach.listen_on([])
    world.answer(reach)
    assert reach.hosts == ()
    assert not alerts.active
    reach.close()


def test_remote_access_setting_is_sent_once_to_each_new_master(world, make):
    reach, _alerts = make()
    reach.listen_on(["192.168.1.20"])
    world.answer(reach)
    again, _alerts = make()
    again.update_graph(GraphView(epoch=7, revision=1))
    world.answer(again)
    again.update_graph(GraphView(epoch=7, revision=2))
    again.update_graph(GraphView(epoch=8, revision=1, listens=("192.168.1.20",)))
    again.close()
    assert len(world.asked) == 2
    assert again.hosts == ("192.168.1.20",)


def test_rejected_remote_access_is_an_alert_with_fix_until_resolved(world, make):
    reach, alerts = make()
    world.refusal = "'192.168.1.20' isn't an address of this computer; its addresses: 10.0.0.7"
    reach.listen_on(["192.168.1.20"])
    world.answer(reach)
    (alert,) = alerts.active
    assert (alert.id, alert.intent) == (ALERT, AllowOtherComputers())
    assert alert.detail == f"{world.refusal}."
    assert reach.hosts == ()
    world.refusal = ""
    reach.listen_on(["10.0.0.7"])
    world.answer(reach)
    assert not alerts.active
    reach.close()


def test_remote_access_setting_that_cannot_be_saved_is_applied_and_reported(world, make, tmp_path):
    reach, alerts = make()
    (tmp_path / "settings.json").mkdir()  # stands for a full disk: the settings can't be written
    for hosts, words in (
        (["192.168.1.20"], "This change couldn't be saved"),
        ([], "This change couldn't be saved"),
    ):
        reach.listen_on(hosts)
        world.answer(reach)
        assert world.asked[-1][0] == tuple(hosts)
        assert reach.hosts == tuple(hosts)
        (alert,) = alerts.active
        assert alert.title == "The list of allowed connections can't be saved."
        assert alert.detail.startswith(words)
    (tmp_path / "settings.json").rmdir()
    reach.listen_on(["192.168.1.20"])
    world.answer(reach)
    assert not alerts.active
    reach.close()


def test_remote_access_setting_is_not_sent_to_master_of_another_computer(make, world):
    near, _alerts = make()
    near.listen_on(["192.168.1.20"])  # saved for the master of this computer
    world.answer(near)
    world.asked.clear()
    near.close()
    reach, _alerts = make("192.168.1.9:7780")
    assert not reach.is_local
    assert reach.master_host == "192.168.1.9"
    reach.update_graph(GraphView(epoch=1, revision=1, listens=("192.168.1.9",)))
    reach.close()
    assert not world.asked


def test_last_remote_access_setting_is_sent_last_despite_slow_first_request(world, make, monkeypatch):
    may_go_on, told = threading.Event(), []

    def slow(hosts, _address):
        if hosts:
            assert may_go_on.wait(60.0)
        told.append(tuple(hosts))

    monkeypatch.setattr(world, "ask", slow)
    reach, _alerts = make()
    reach.listen_on(["192.168.1.20"])
    reach.listen_on([])
    assert told == []
    may_go_on.set()
    reach.close()
    assert told == [("192.168.1.20",), ()]
