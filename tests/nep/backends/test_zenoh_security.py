"""Tests of Zenoh's TLS and access control with a router that requires certificates."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import nep
from tests.nep.programs import eventually, running

pytestmark = pytest.mark.skipif(
    shutil.which("openssl") is None, reason="certificates are made by openssl (Debian: openssl)"
)
LONG_S = 30.0
ROUTER = """
import sys, zenoh
with zenoh.open(zenoh.Config.from_file(sys.argv[1])):
    print("routes")
    sys.stdin.read()
"""
_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
_NAMES = "subjectAltName=DNS:localhost,IP:127.0.0.1"
_MESSAGES = [
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable", "liveliness_token",
    "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip
OPEN = ["nep/v1/live/**", "nep/v1/call/**", "nep/v1/hello/**", "nep/v1/data/open", "nep/v1/serve/open/**"]
"""Key expressions allowed to guests: discovery, the topic `open` and the service `open`."""


@dataclass(frozen=True)
class Lab:
    """Router with the certificates of `robot` and `guest`, and of `stranger`, which is self-signed."""

    folder: Path
    endpoint: str

    def master(self, certificate: str, authority: str = "authority") -> str:
        """Return the configuration file of a node with this certificate; "" means without one."""
        tls: dict[str, object] = {"root_ca_certificate": str(self.folder / f"{authority}.pem")}
        if certificate:
            tls |= {
                "connect_certificate": str(self.folder / f"{certificate}.pem"),
                "connect_private_key": str(self.folder / f"{certificate}.key"),
                "enable_mtls": True,
            }
        told = {
            "mode": "client",
            "connect": {"endpoints": [self.endpoint]},
            "transport": {"link": {"tls": tls}},
        }
        file = self.folder / f"{certificate or 'nobody'}-{authority}.json5"
        file.write_text(json.dumps(told))
        return str(file)


def make_certificates(folder: Path) -> None:
    def openssl(*words: str) -> None:
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    for name in ("authority", "stranger"):
        subject = ("-subj", f"/CN={'robot' if name == 'stranger' else name}")  # claims the robot's name
        openssl(
            "req", "-x509", *_KEY, "-keyout", f"{name}.key", "-out", f"{name}.pem", "-days", "2", *subject
        )
    signed = (
        "-CA",
        "authority.pem",
        "-CAkey",
        "authority.key",
        "-CAcreateserial",
        "-copy_extensions",
        "copy",
    )
    for name in ("router", "robot", "guest"):
        subject = ("-subj", f"/CN={name}", "-addext", _NAMES)
        openssl("req", *_KEY, "-keyout", f"{name}.key", "-out", f"{name}.csr", *subject)
        openssl("x509", "-req", "-in", f"{name}.csr", *signed, "-days", "2", "-out", f"{name}.pem")


def rule(name: str, keys: list[str]) -> dict[str, object]:
    allowed = {"id": name, "permission": "allow", "flows": ["ingress", "egress"]}
    return allowed | {"messages": _MESSAGES, "key_exprs": keys}


def router(folder: Path, endpoint: str) -> str:
    """Return the router's configuration file.

    Robots may do everything, guests only what is open, others nothing.
    """
    told = {
        "mode": "router",
        "listen": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {
            "link": {
                "tls": {
                    "root_ca_certificate": str(folder / "authority.pem"),
                    "listen_certificate": str(folder / "router.pem"),
                    "listen_private_key": str(folder / "router.key"),
                    "enable_mtls": True,
                }
            }
        },
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [rule("everything", ["nep/v1/**"]), rule("some", OPEN)],
            "subjects": [
                {"id": "robots", "cert_common_names": ["robot"]},
                {"id": "guests", "cert_common_names": ["guest"]},
            ],
            "policies": [
                {"rules": ["everything"], "subjects": ["robots"]},
                {"rules": ["some"], "subjects": ["guests"]},
            ],
        },
    }
    file = folder / "router.json5"
    file.write_text(json.dumps(told))
    return str(file)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    folder = tmp_path_factory.mktemp("lab")
    make_certificates(folder)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tls/127.0.0.1:{free.getsockname()[1]}"
    with running(ROUTER, router(folder, endpoint)) as program:
        assert program.line() == "routes"
        yield Lab(folder, endpoint)


Make = Callable[..., nep.Node]


@pytest.fixture
def make(lab: Lab) -> Iterator[Make]:
    made: list[nep.Node] = []

    def new(name: str, certificate: str = "robot") -> nep.Node:
        made.append(nep.node(name, "zenoh", master=lab.master(certificate)))
        return made[-1]

    yield new
    for node in made:
        node.close()


def test_messages_and_calls_are_exchanged_with_certificates(make: Make) -> None:
    sub = make("a").new_sub("secret")
    other = make("b")
    pub = other.new_pub("secret", latched=True)
    assert (pub.subscribers, pub.missing) == (1, ())
    for number in range(3):
        pub.publish(number)
    assert [sub.listen(timeout_s=LONG_S)[1] for _ in range(3)] == [0, 1, 2]
    assert make("c").new_sub("secret").listen(timeout_s=LONG_S) == (True, 2)
    other.new_server("/x", lambda request: request, threads=1)
    assert make("d").new_client("/x").call({"n": 1}, timeout_s=LONG_S) == {"n": 1}
    assert {each.name for each in other.graph().nodes.values()} == {"a", "b", "c", "d"}


def test_connection_starts_with_a_tls_handshake(lab: Lab) -> None:
    """The first bytes that a node sends are a TLS handshake."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(LONG_S)
        file = Path(lab.master("robot"))
        there = f"tls/127.0.0.1:{listening.getsockname()[1]}"
        other = lab.folder / "tapped.json5"
        other.write_text(file.read_text().replace(lab.endpoint, there))

        said: list[bytes] = []

        def accept() -> None:
            with listening.accept()[0] as connection:
                connection.settimeout(LONG_S)
                said.append(connection.recv(3))

        tap = threading.Thread(target=accept, name="tap")
        tap.start()
        with nep.node("a", "zenoh", master=str(other)) as node, pytest.raises(nep.NepError):
            node.new_pub("t")
        tap.join(LONG_S)
    assert said[0][:2] == b"\x16\x03"


@pytest.mark.parametrize(
    ("certificate", "authority"), [("", "authority"), ("stranger", "authority"), ("robot", "stranger")]
)
def test_missing_or_untrusted_certificate_is_rejected_with_a_message(
    lab: Lab, certificate: str, authority: str
) -> None:
    """Covers no certificate, a self-signed one, and an untrusted certificate of the router."""
    with nep.node("a", "zenoh", master=lab.master(certificate, authority), wait_s=1.0) as node:
        for make in (lambda: node.new_pub("open"), lambda: node.new_client("open"), node.graph):
            with pytest.raises(nep.NepError, match=r"\.json5': .*trusts the certificate"):
                make()


@pytest.mark.parametrize("protocol", ["tls", "tcp"])
def test_endpoint_without_certificate_is_rejected(lab: Lab, protocol: str) -> None:
    where = lab.endpoint.replace("tls/", f"{protocol}/")
    with (
        nep.node("a", "zenoh", master=where, wait_s=0.2) as node,
        pytest.raises(nep.NepError, match=f"'{where}': "),
    ):
        node.new_sub("open")


def test_missing_certificate_files_are_reported(lab: Lab) -> None:
    with (
        nep.node("a", "zenoh", master=lab.master("missing"), wait_s=1.0) as node,
        pytest.raises(nep.NepError, match=r"\.json5': "),
    ):
        node.new_sub("open")


def test_denied_topic_delivers_nothing_and_losses_are_known_when_its_publisher_closes(make: Make) -> None:
    """As docs/zenoh.md explains, a router reports to no node that it denies something."""
    robot, guest = make("robot"), make("guest", "guest")
    secret, opened = guest.new_sub("secret"), guest.new_sub("open")
    pub, other = robot.new_pub("secret"), robot.new_pub("open")
    assert (pub.subscribers, other.subscribers) == (1, 1)
    pub.publish(1)
    other.publish(2)
    assert opened.listen(timeout_s=LONG_S) == (True, 2)
    assert secret.listen() == (False, {})
    assert secret.lost == 0
    latched = robot.new_pub("told", latched=True)
    latched.publish("by its hello")
    told = guest.new_sub("told")
    assert told.listen(timeout_s=LONG_S) == (True, "by its hello"), "hellos are allowed to guests"
    pub.close()
    eventually(lambda: secret.lost == 1)
    wanted = robot.new_sub("secret")
    forbidden = guest.new_pub("secret")
    forbidden.publish(3)
    forbidden.close()
    eventually(lambda: wanted.lost == 1)
    assert wanted.received == 0


def test_denied_service_is_reported_at_the_call(make: Make) -> None:
    robot, guest = make("robot"), make("guest", "guest")
    seen = []
    for name in ("secret", "open"):
        robot.new_server(name, lambda request: seen.append(request) or request, threads=1)
    assert guest.new_client("open").call(1, timeout_s=LONG_S) == 1
    secret = guest.new_client("secret")
    assert secret.is_connected
    with pytest.raises(nep.NepError, match=r"'secret' .*'nep/v1/serve/secret/"):
        secret.call(2, timeout_s=LONG_S)
    assert robot.new_client("secret").call(3, timeout_s=LONG_S) == 3
    assert seen == [1, 3]
