"""Tests of the test page and the starter page, served by plain HTTP at the port of the server."""

from __future__ import annotations

import http.client
import re
import socket
from contextlib import suppress
from http import HTTPStatus

import pytest

from nep.masters.master import Master
from nep.programs.web import Access, WebServer, WebSettings
from nep.programs.web.served_pages import PageRequest, respond, starter_page
from nep.protocol.wire import check_topic
from tests.nep.web.conftest import Peer

TOKEN = "a-token-of-some-letters"
OWN = "http://192.168.1.5:9090"


def asked(
    path: str = "/", method: str = "GET", hosts: tuple[str, ...] = ("192.168.1.5:9090",), token: str = ""
) -> tuple[int, str]:
    access = Access({"http://lab.example.org"}, token)
    found = respond(PageRequest(method, path, hosts, OWN), access)
    return found.status.value, found.body.decode()


@pytest.mark.parametrize(
    ("hosts", "is_served"),
    [
        (("192.168.1.5:9090",), True),
        (("localhost:9090",), True),
        (("127.0.0.1",), True),
        (("[::1]:9090",), True),
        (("lab.example.org",), True),
        (("192.168.1.5",), False),
        (("evil.example:9090",), False),
        (("evil.example@localhost",), False),
        (("localhost/x",), False),
        (("localhost; script-src *",), False),
        (("localhost\x00",), False),
        (("",), False),
        ((), False),
        (("localhost", "evil.example"), False),
    ],
)
def test_page_is_served_only_for_valid_and_allowed_host_headers(
    hosts: tuple[str, ...], is_served: bool
) -> None:
    status, body = asked(hosts=hosts)
    assert status == (HTTPStatus.OK if is_served else HTTPStatus.FORBIDDEN)
    assert is_served or OWN in body


def test_unknown_paths_and_methods_are_rejected() -> None:
    for path in (
        "/x",
        "//",
        "/../etc/passwd",
        "/%2e%2e/",
        "/test.html",
        "http://h/",
        "*",
        "",
        "/\x00",
        "/[",
        "/;?",
    ):
        assert asked(path)[0] == HTTPStatus.NOT_FOUND
    for method in ("POST", "PUT", "OPTIONS", "CONNECT", "get", "", "\x00"):
        assert asked(method=method)[0] == HTTPStatus.METHOD_NOT_ALLOWED


@pytest.mark.parametrize("path", ["/", "/starter.html"])
def test_token_is_required_for_pages_and_absent_from_rejections(path: str) -> None:
    for query in ("", "?token=", "?token=wrong", "?token=wrong&token=x", "?x=" + TOKEN):
        status, body = asked(path + query, token=TOKEN)
        assert (status, TOKEN in body) == (HTTPStatus.UNAUTHORIZED, False)
    status, body = asked(f"{path}?token={TOKEN}", token=TOKEN)
    assert (status, TOKEN in body) == (HTTPStatus.OK, path == "/starter.html")


def test_content_security_policy_allows_only_hashed_inline_code_and_no_external_resources() -> None:
    found = respond(PageRequest("GET", "/", ("localhost:9090",), OWN), Access())
    policy = found.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self' ws://localhost:9090;" in policy
    assert "unsafe" not in policy
    assert len(re.findall("sha256-", policy)) == 2
    assert found.headers["X-Content-Type-Options"] == "nosniff"
    for page in (found.body.decode(), starter_page("ws://127.0.0.1:9090")):
        assert not re.search(r"<(?:link|script|img)[^>]+(?:src|href)=\"(?!data:)", page)
        assert "{{" not in page


def test_address_of_a_starter_page_cannot_break_out_of_its_script() -> None:
    page = starter_page("ws://h/?token=</script>\"'")
    assert page.count("</script>") == 1
    for topic in re.findall(r'topic: "(.*?)"', page):
        check_topic(topic)


def response(server: WebServer, path: str, **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    connection.request("GET", path, headers=headers)
    found = connection.getresponse()
    body = found.read().decode()
    connection.close()
    return found.status, body


def test_server_serves_http_and_websockets_on_one_port(server: WebServer, page: Peer) -> None:
    status, body = response(server, "/")
    assert (status, "<!doctype html>" in body) == (HTTPStatus.OK, True)
    assert f"ws://127.0.0.1:{server.port}/" in response(server, "/starter.html")[1]
    assert response(server, "/favicon.ico")[0] == HTTPStatus.NOT_FOUND
    assert response(server, "/", Host="evil.example")[0] == HTTPStatus.FORBIDDEN
    assert server.counts.turned_away == 0
    assert page.refusal("nothing")


def test_page_opened_without_the_token_is_listed_as_rejected(master: Master) -> None:
    settings = WebSettings(port=0, master=master.address, access=Access(token=TOKEN))
    with WebServer(settings) as server:
        assert response(server, "/")[0] == HTTPStatus.UNAUTHORIZED
        assert [(each.kind, each.client) for each in server.rejections] == [("token", "127.0.0.1")]
        path = server.test_page_url.partition(str(server.port))[2]
        assert response(server, path)[0] == HTTPStatus.OK


@pytest.mark.parametrize(
    "data",
    [
        b"\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /\xff HTTP/1.1\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\nUpgrade: \x80\r\n\r\n",
        b"GET /" + b"x" * 20_000 + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 1_000 + b"\r\n",
    ],
)
def test_malformed_request_is_rejected_without_a_traceback(
    server: WebServer, data: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    with socket.create_connection(("127.0.0.1", server.port), 30) as raw:
        first = b""
        with suppress(ConnectionError):  # closed before everything was read
            raw.sendall(data)
            first = raw.recv(20)
    assert first == b"" or re.match(rb"HTTP/1\.1 [45]\d\d", first)
    assert not [each for each in caplog.records if each.exc_info]
    assert server.problem is None
