"""Tests of changes of a running server (origins, token, robots, Foxglove) and of its list of pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

import nep
from nep.errors import NepError
from nep.masters.master import Master
from nep.programs.web import Access, ConnectedPage, WebServer, WebSettings
from nep.recordings.formats.channels import LiveChannels
from tests.nep.programs import eventually
from tests.nep.web.conftest import Peer

Open = Callable[..., Peer]
LAPTOP, TABLET = "http://192.168.1.20:8080", "http://192.168.1.30"
CHROME = (
    "Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/140.0.0.0 Safari/537.36"
)


def is_open(connection: ClientConnection) -> bool:
    try:
        return bool(Peer(connection).refusal("nothing"))
    except ConnectionClosed:
        return False


def refused_to_connect(server: WebServer, path: str = "", **options: object) -> bool:
    try:
        connect(server.url + path, **options).close()
    except InvalidStatus:
        return True
    return False


def test_removed_origin_is_disconnected_and_other_pages_stay_connected(
    server: WebServer, open_page: Open
) -> None:
    assert server.set_access(Access({LAPTOP, TABLET})) == 0
    laptop, tablet = open_page(origin=LAPTOP), open_page(origin=TABLET)
    program, own = open_page(), open_page(origin=f"http://127.0.0.1:{server.port}")
    eventually(lambda: len(server.pages) == 4)
    assert server.set_access(Access({LAPTOP, "https://lab.example.org"})) == 1
    assert len(server.pages) == 3
    assert not is_open(tablet.connection)
    assert all(is_open(each.connection) for each in (laptop, program, own))
    assert refused_to_connect(server, origin=TABLET)


def test_new_token_disconnects_all_clients_with_the_old_token(server: WebServer, open_page: Open) -> None:
    before = open_page()
    eventually(lambda: len(server.pages) == 1)
    assert server.set_access(Access(token="first-token-of-all")) == 1
    assert not is_open(before.connection)
    with connect(f"{server.url}/?token=first-token-of-all") as page, connect(server.url) as locked:
        eventually(lambda: len(server.pages) == 1)
        assert server.set_access(Access({LAPTOP}, "first-token-of-all")) == 0
        assert server.set_access(Access(token="second-token-of-all")) == 1
        assert not is_open(page)
        Peer(locked).send("subscribe", topic="/t")
        assert not is_open(locked)
    assert refused_to_connect(server, "/?token=first-token-of-all")
    with connect(f"{server.url}/?token=second-token-of-all") as page:
        assert server.set_access(Access()) == 0
        assert is_open(page)
    assert [each.kind for each in server.rejections] == ["token", "token"]


def test_token_of_a_server_for_other_computers_cannot_be_removed(master: Master) -> None:
    server = WebServer(WebSettings(listen=("0.0.0.0",), access=Access(token="a-token-of-some-letters")))
    with pytest.raises(NepError):
        server.set_access(Access())
    assert server.settings.access.token


def test_robots_are_allowed_and_denied_while_a_page_is_connected(
    server: WebServer, node: nep.Node, page: Peer
) -> None:
    description = {"title": "Rover", "rb:topics": {"command": "/orders"}}
    orders = node.new_sub("/orders")
    node.new_pub("/Rover/description", "robot/description", latched=True).publish(description)
    eventually(lambda: server._guard.denial_reason("/orders") != "")
    assert "Rover" in page.refusal("publish", topic="/orders", msg=1)
    page.refusal("publish", topic="/orders", msg=2)
    (refused,) = server.rejections  # at most one entry in ten seconds
    assert (refused.kind, refused.robot, refused.client) == ("robot", "Rover", "127.0.0.1")
    server.set_allow_moving(["Rover"])
    page.send("publish", topic="/orders", msg=3)
    assert orders.listen(timeout_s=30) == (True, 3)
    server.set_allow_moving(())
    assert "Rover" in page.refusal("publish", topic="/orders", msg=4)
    assert orders.received == 1


def test_foxglove_is_enabled_and_disabled_without_a_restart(server: WebServer, page: Peer) -> None:
    subprotocols = ["foxglove.sdk.v1"]
    server.set_foxglove(LiveChannels())
    with connect(server.url, subprotocols=subprotocols) as client:
        assert client.subprotocol in subprotocols
        eventually(lambda: [each.protocol for each in server.pages] == ["rosbridge", "foxglove"])
        assert server.pages[1].client == "Foxglove"
        assert server.set_foxglove(None) == 1
        while is_open(client):
            pass
        assert client.close_code == 1008
    assert is_open(page.connection)


@pytest.fixture
def connected(server: WebServer) -> Iterator[Callable[..., ConnectedPage]]:
    """Function that connects with the given options and returns the server's entry for the page."""

    def shown(path: str = "", **options: object) -> ConnectedPage:
        with connect(server.url + path, **options):
            eventually(lambda: len(server.pages) == 1)
            (found,) = server.pages
        eventually(lambda: not server.pages)
        return found

    return shown


def test_client_name_and_title_of_a_page_are_derived_from_its_request(
    connected: Callable[..., ConnectedPage],
) -> None:
    browser = connected("/?title=buttons.html", user_agent_header=CHROME, origin="http://localhost:8000")
    assert (browser.client, browser.title) == ("Chrome", "buttons.html")
    referer = {"Referer": "http://localhost:8000/a/dash%20board.html?x#y"}
    assert connected(additional_headers=referer).title == "dash board.html"
    assert connected(origin="http://localhost:8000").title == "localhost:8000"
    program = connected(user_agent_header="AutobahnPython/24.4.2")
    assert (program.client, program.title) == ("roslibpy", program.name)
    hostile = connected(f"/?title=%1b[31m{'x' * 300}", user_agent_header="y" * 5_000)
    assert hostile.title.startswith("\\x1b[31m")
    assert (len(hostile.title), len(hostile.client)) == (60, 60)


def test_rate_limit_rate_and_message_count_are_reported_for_each_topic_of_a_page(
    server: WebServer, node: nep.Node, page: Peer
) -> None:
    odom = node.new_pub("/odom")
    page.send("subscribe", topic="/odom", throttle_rate=100)
    page.send("advertise", topic="/buttons", type="nep/Json")
    page.send("publish", topic="/buttons", msg={"pressed": True})
    eventually(lambda: odom.subscribers == 1)
    odom.publish({"x": 1})
    page.receive("publish")
    eventually(lambda: [each.sent_count for each in server.pages[0].topics] == [1, 1])
    reads, publishes = server.pages[0].topics
    assert (reads.topic, reads.is_published, reads.max_rate_hz) == ("/odom", False, 10)
    assert (publishes.topic, publishes.is_published, publishes.max_rate_hz) == ("/buttons", True, None)

    def are_measured() -> bool:  # a rate is that of the last two seconds
        odom.publish({"x": 1})
        page.send("publish", topic="/buttons", msg={"pressed": True})
        return all(each.rate_hz > 0 and each.bytes_per_s > 10 for each in server.pages[0].topics)

    eventually(are_measured)
    assert server.pages[0].published_topics == ("/buttons",)


def test_page_is_identified_as_a_web_page_in_the_graph(server: WebServer, node: nep.Node, page: Peer) -> None:
    eventually(lambda: "web" in {each.language for each in node.graph().nodes.values()})
    names = {each.name for each in node.graph().nodes.values() if each.language == "web"}
    assert names == {each.name for each in server.pages}


def test_blocked_page_is_rejected_until_unblocked(server: WebServer, open_page: Open) -> None:
    own = f"http://127.0.0.1:{server.port}"
    first, twin, other = open_page(origin=own), open_page(origin=own), open_page()
    eventually(lambda: len(server.pages) == 3)
    page_id = server.pages[0].id
    server.block_page(page_id)
    assert not is_open(first.connection)
    assert is_open(twin.connection)
    assert is_open(other.connection)
    assert refused_to_connect(server, origin=own)
    assert server.rejections[-1].kind == "kept out"
    server.unblock_page(page_id)
    assert is_open(open_page(origin=own).connection)


def test_rosbridge_can_be_disabled_while_foxglove_is_served(server: WebServer, open_page: Open) -> None:
    page = open_page()
    server.set_foxglove(LiveChannels())
    eventually(lambda: len(server.pages) == 1)
    assert server.set_rosbridge(False) == 1
    assert not is_open(page.connection)
    assert refused_to_connect(server)
    with connect(server.url, subprotocols=[Subprotocol("foxglove.sdk.v1")]) as viewer:
        assert viewer.subprotocol == "foxglove.sdk.v1"
    server.set_rosbridge(True)
    assert is_open(open_page().connection)
