"""Tests of Studio's web server: switches, settings that apply immediately, and its status messages."""

from __future__ import annotations

import queue
import socket
from collections.abc import Iterator

import pytest

from app.core.network.web_page_list import GONE_DISPLAY_S, PageList
from app.core.network.web_pages import WebPages, WebServerStarted
from app.core.network.web_texts import notices, page_name, share_text, terminal_command, web_status
from nep.errors import NepError
from nep.masters.master import master_address
from nep.programs.web.context import PageTopic, Rejection
from nep.system.addresses import OwnAddress
from tests.core.network.fake_web_server import FakeWebServer, page

WIFI = OwnAddress("192.168.1.20", "wlan0")


class Studio:
    """`WebPages` with fake servers; `wait` applies the result of a start."""

    def __init__(self) -> None:
        self.servers: list[FakeWebServer] = []
        self.events: queue.Queue[WebServerStarted] = queue.Queue()
        self.now = 100.0
        self.web = WebPages(
            master_address(), self.events.put, start=self._start, addresses=lambda: (WIFI,),
            clock=lambda: self.now,
        )  # fmt: skip

    def _start(self, settings) -> FakeWebServer:
        self.servers.append(FakeWebServer(settings))
        return self.servers[-1]

    def wait(self) -> FakeWebServer:
        self.web.on_started(self.events.get(timeout=30))
        return self.servers[-1]

    def switch_on(self) -> FakeWebServer:
        self.web.set_protocol_enabled("rosbridge", on=True)
        return self.wait()


@pytest.fixture
def studio() -> Iterator[Studio]:
    made = Studio()
    yield made
    made.web.close()


def test_settings_of_a_running_server_change_without_a_restart(studio: Studio) -> None:
    web, server = studio.web, studio.switch_on()
    web.add_origin("http://lab.example:80/")
    web.set_robots(["Turtle", "Turtle"])
    web.set_protocol_enabled("foxglove", on=True)
    assert server.access.origins == {"http://lab.example"}
    assert server.allow_moving == {"Turtle"}
    assert server.foxglove is not None
    assert studio.servers == [server]
    with pytest.raises(NepError):
        web.add_origin("lab")
    web.set_origins(())
    assert server.access.origins == frozenset()


def test_settings_changed_during_the_start_reach_the_server(studio: Studio) -> None:
    studio.web.set_protocol_enabled("rosbridge", on=True)
    studio.web.set_robots(["Turtle"])
    assert studio.wait().allow_moving == {"Turtle"}


def test_server_stops_when_its_last_protocol_is_disabled(studio: Studio) -> None:
    server = studio.switch_on()
    studio.web.set_protocol_enabled("foxglove", on=True)
    studio.web.set_protocol_enabled("rosbridge", on=False)
    assert (studio.web.state, server.has_ended, server.rosbridge) == ("on", False, False)
    studio.web.set_protocol_enabled("foxglove", on=False)
    studio.web.close()
    assert (studio.web.state, server.has_ended) == ("off", True)


def test_address_change_restarts_the_server_with_a_token(studio: Studio) -> None:
    first = studio.switch_on()
    studio.web.listen_on(WIFI.host)
    second = studio.wait()
    assert first.has_ended
    assert second.settings.listen == (WIFI.host,)
    assert second.access.token == studio.web.token != ""
    assert studio.web.page_url == f"http://192.168.1.20:9090/?token={studio.web.token}"
    assert studio.web.local_page_url == f"http://127.0.0.1:9090/?token={studio.web.token}"


def test_new_token_disconnects_pages_and_the_old_one_can_be_restored(studio: Studio) -> None:
    studio.web.listen_on(WIFI.host)
    server = studio.switch_on()
    server.pages = (page(1), page(2))
    before = studio.web.token
    assert studio.web.generate_token() == 2
    assert server.access.token == studio.web.token != before
    studio.web.set_token(before)
    assert server.access.token == before


def test_occupied_port_is_reported_and_a_free_port_is_suggested(studio: Studio) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        web = WebPages(master_address(), studio.events.put, addresses=tuple)
        web.port = taken.getsockname()[1]
        web.set_protocol_enabled("rosbridge", on=True)
        web.on_started(studio.events.get(timeout=30))
        assert (web.state, web.protocols) == ("off", frozenset())
        assert str(web.port) in web.sentence
        assert web.free_port > web.port
        web.close()


def test_start_without_optional_libraries_gives_install_advice(studio: Studio) -> None:
    def start(_settings: object) -> FakeWebServer:
        raise NepError("the web server isn't installed; install it with: pip install 'nep-studio[web]'")

    web = WebPages(master_address(), studio.events.put, start=start, addresses=tuple)
    web.set_protocol_enabled("rosbridge", on=True)
    web.on_started(studio.events.get(timeout=30))
    assert (web.state, web.protocols, web.free_port) == ("off", frozenset(), 0)
    assert web.sentence.startswith("The web server")
    assert "pip install" in web.sentence
    web.close()


def test_unexpected_server_exit_is_detected(studio: Studio) -> None:
    server = studio.switch_on()
    server.has_ended = True
    studio.web.check()
    assert (studio.web.state, studio.web.protocols) == ("off", frozenset())
    assert studio.web.sentence


def test_disconnected_page_stays_listed_for_a_while(studio: Studio) -> None:
    server = studio.switch_on()
    server.pages = (page(1), page(2))
    studio.web.refresh()
    server.leave(1)
    studio.now += 4
    studio.web.refresh()
    studio.now += 4
    studio.web.refresh()
    assert [(each.page.id, each.gone_s) for each in studio.web.listed_pages] == [(1, 4.0), (2, None)]
    assert [each.id for each in studio.web.connected] == [2]
    studio.now += GONE_DISPLAY_S
    studio.web.refresh()
    assert [each.page.id for each in studio.web.listed_pages] == [2]


def test_topic_of_a_page_is_slow_while_messages_are_dropped() -> None:
    pages = PageList()
    for now, dropped in ((0.0, 0), (1.0, 3), (5.0, 3)):
        pages.update([page(1, PageTopic("/camera", False, sent_count=997, dropped_count=dropped))], now)
    assert [(each.topic, share_text(each.dropped_share)) for each in pages.slow_topics()] == [
        ("/camera", "0.3 %")
    ]
    pages.update([page(1, PageTopic("/camera", False, sent_count=2_000, dropped_count=3))], 20.0)
    assert list(pages.slow_topics()) == []


def test_rejection_notices_offer_a_fix_until_allowed_or_dismissed(studio: Studio) -> None:
    server = studio.switch_on()
    origin = "http://192.168.1.77:5173"
    server.rejections = (
        Rejection(1.0, origin, "refused", origin, "origin"),
        Rejection(2.0, "192.168.1.78", "wrong", kind="token"),
        Rejection(3.0, origin, "refused", kind="robot", robot="Turtle"),
        Rejection(4.0, origin, "refused", origin, "origin"),
    )
    found = notices(studio.web)
    assert [(each.next_step, each.value) for each in found] == [
        ("allow origin", origin), ("choose robots", "Turtle"), ("", ""),
    ]  # fmt: skip
    assert len(notices(studio.web, {found[2].key})) == 2
    studio.web.add_origin(origin)
    studio.web.set_robots(["Turtle"])
    assert notices(studio.web) == found[2:]


def test_page_disconnected_by_user_can_be_allowed_again(studio: Studio) -> None:
    server = studio.switch_on()
    first = page(1)
    server.pages = (first,)
    studio.web.block_page(first)
    assert (server.pages, server.kept_out) == ((), {1})
    assert notices(studio.web) == ()
    server.rejections = (Rejection(5.0, first.origin, "disconnected", kind="kept out"),)
    (notice,) = notices(studio.web)
    assert (notice.next_step, notice.value) == ("let in", "1")
    studio.web.unblock_page(1)
    assert (server.kept_out, notices(studio.web)) == (set(), ())


def test_terminal_command_has_the_current_settings(studio: Studio) -> None:
    web = studio.web
    assert terminal_command(web, "linux") == "nep web"
    web.listen_on(WIFI.host)
    web.port = 9091
    web.add_origin("http://lab.example")
    web.set_robots(["Big Turtle"])
    web.protocols = frozenset({"rosbridge", "foxglove"})
    assert terminal_command(web, "linux") == (
        "nep web --port 9091 --listen 192.168.1.20 --origin http://lab.example "
        "--allow-moving 'Big Turtle' --foxglove"
    )
    assert '--allow-moving "Big Turtle"' in terminal_command(web, "win32")


def test_status_warns_while_other_computers_can_connect(studio: Studio) -> None:
    assert web_status(studio.web, "")[1] == ""
    studio.switch_on()
    assert web_status(studio.web, "")[2] is None
    studio.web.listen_on(WIFI.host)
    studio.wait().pages = (page(1),)
    studio.web.refresh()
    icon, words, status = web_status(studio.web, "Wi-Fi 192.168.1.20")
    assert (icon, status) == ("globe", "warn")
    assert "192.168.1.20" in words


def test_program_without_title_is_named_by_its_library() -> None:
    named = page(1)
    program = page(2, title="web_lab.example_2", origin="")
    assert (page_name(named), page_name(program)) == ("page1.html", "Chrome")
