"""Tests of access to the web server: origins of pages, and tokens."""

from __future__ import annotations

import hashlib

import pytest

from nep.errors import NepError
from nep.programs.web.access import Access, AuthVerifier, checked_origin
from nep.programs.web.messages.operations import Auth
from nep.programs.web.server import WebServer, WebSettings, node_name


@pytest.mark.parametrize(
    ("origin", "is_allowed"),
    [
        (None, True),
        ("http://localhost:8000", True),
        ("https://127.0.0.1", True),
        ("http://[::1]:5173", True),
        ("http://192.168.1.5:8000", True),
        ("http://192.168.1.5", False),
        ("https://192.168.1.5:8000", False),
        ("http://evil.example", False),
        ("http://localhost.evil.example", False),
        ("http://127.0.0.1.evil.example", False),
        ("http://evil.example/@localhost", False),
        ("http://localhost@evil.example", False),
        ("null", False),
        ("file://", False),
        ("", False),
        ("\x1b[31m", False),
        ("http://[::1", False),
        ("http://local\thost:8000", False),
        ("http://localhost:99999", False),
    ],
)
def test_page_connects_only_from_an_allowed_origin(origin: str | None, is_allowed: bool) -> None:
    refusal = Access(frozenset({"http://192.168.1.5:8000"})).origin_rejection_reason(origin)
    assert (refusal == "") is is_allowed
    assert refusal.isprintable()


def test_pages_served_by_the_web_server_are_allowed_at_its_address_only() -> None:
    own = "http://192.168.1.5:9090"
    assert Access().origin_rejection_reason(own, own) == ""
    for other in ("http://192.168.1.5:8000", "https://192.168.1.5:9090", "http://192.168.1.6:9090"):
        assert Access().origin_rejection_reason(other, own)
    assert Access().origin_rejection_reason("", "")


def test_origin_is_normalized_as_by_browsers() -> None:
    assert checked_origin("HTTP://Example.ORG:80/") == "http://example.org"
    for origin in ("null", "file://"):
        assert Access({checked_origin(origin)}).origin_rejection_reason(origin) == ""
    for wrong in ("example.org", "ws://example.org", "http://", "*", "http://a/b", "http://a?b"):
        with pytest.raises(NepError):
            checked_origin(wrong)


def test_token_is_read_from_the_url_or_the_header() -> None:
    access = Access(token="s3cret")
    assert access.check_token("/?token=s3cret", None)
    assert access.check_token("/a/b?x=1&token=s3cret", None)
    assert access.check_token("/", "Bearer s3cret")
    assert access.check_token("/", "bearer  s3cret")
    assert access.check_token("/", None) is None
    assert access.check_token("/", "Basic s3cret") is None
    for path, header in (("/?token=wrong", None), ("/", "Bearer é"), ("/?token=%ff", None)):
        assert access.check_token(path, header) is False


def signed(token: str, time_s: int, end_s: int, rand: str = "r") -> Auth:
    text = f"{token}cd{rand}{time_s}user{end_s}"
    return Auth(None, hashlib.sha512(text.encode()).hexdigest(), "c", "d", rand, time_s, "user", end_s)


def test_auth_signature_is_accepted_once_and_for_a_limited_time() -> None:
    check = AuthVerifier("s3cret", clock=lambda: 1_000.0)
    assert check.verify(signed("s3cret", 1_001, 2_000))
    assert not check.verify(signed("s3cret", 1_001, 2_000))
    assert check.verify(signed("s3cret", 1_001, 2_000, "other"))
    assert not check.verify(signed("wrong", 1_001, 2_000))
    assert not check.verify(signed("s3cret", 900, 2_000))
    assert not check.verify(signed("s3cret", 1_001, 999))


def test_server_for_other_computers_needs_a_token() -> None:
    with pytest.raises(NepError):
        WebServer(WebSettings(port=0, listen=("192.0.2.1",))).start()


def test_node_name_has_the_origin_of_the_page_or_the_address_of_the_program() -> None:
    assert node_name("http://localhost:8000", "127.0.0.1:5001") == "web_localhost:8000_5001"
    assert node_name(None, "127.0.0.1:5001") == "web_127.0.0.1:5001"
    assert len(node_name("http://" + "x" * 500, "127.0.0.1:5001")) <= 150
