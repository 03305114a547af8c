"""Computers of a test: network and process namespaces, joined by a switch.

Nothing of it has a name in the system that could be taken or stay behind: a namespace lives as long as a
process in it. Each host has a first process that reads its standard input; when this program ends, also by
`kill -9`, that input ends, so does the first process, and the system kills everything else in there.

A user who is not root gets a namespace of users as well, where the system lets him.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from threading import Lock

import psutil

_TIMEOUT_S = 20.0
_SWITCH = "switch"
_NET = "10.88.0"
_FIRST = "mount -t tmpfs tmpfs /dev/shm; ip link set lo up; hostname {name}; echo; exec cat"
"""Memory and abstract sockets are shared on one computer only."""
_ANNOUNCE = (
    "sleep {wait_s}; echo 1 > /proc/sys/net/ipv4/conf/eth0/arp_notify; ip link set eth0 address {number}"
)
_ARP_LOCK_S = 1.1
"""Hosts ignore an announcement of an address that they learned within the last second (`locktime`)."""
_ESTABLISHED = "01"
_RANDOM, _EVER = 0xFFFFF038, 2**32 - 1
_PROGRAM = "4,32 0 0 {random},37 1 0 {below},6 0 0 2,6 0 0 {pass_on},"
"""For the kernel's packet filter: a random number; above the bound the packet goes on, else it is dropped."""


class CannotMakeHostsError(Exception):
    """This computer has no namespaces for this user, or lacks a command."""


class Host:
    """A computer. `address` is its IPv4 address; everything in it is killed with it."""

    def __init__(self, name: str, address: str, before: Sequence[str]) -> None:
        self.name, self.address = name, address
        options = ["--net", "--pid", "--mount-proc", "--uts", "--fork", "--kill-child"]
        self._outer = subprocess.Popen(
            [*before, "unshare", *options, "sh", "-c", _FIRST.format(name=name)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self._outer.stdout is not None
        if not self._outer.stdout.readline():
            raise CannotMakeHostsError(self._outer.communicate()[1].strip() or "unshare failed")
        self.pid = psutil.Process(self._outer.pid).children(recursive=True)[-1].pid
        """Of its first process."""

    def inside(self) -> list[str]:
        """The words that start a program on this computer. It ends with the process that these make."""
        enter = [*_entering(self.pid), "--net", "--pid", "--mount", "--uts"]
        return [*enter, "setpriv", "--pdeathsig", "KILL"]

    def run(self, *words: str) -> str:
        """What a command on this computer prints. Raises `subprocess.CalledProcessError`."""
        done = subprocess.run(
            [*self.inside(), *words], check=True, capture_output=True, text=True, timeout=_TIMEOUT_S
        )
        return done.stdout

    def change_address(self, new: str) -> None:
        """What another Wi-Fi does: the old address is gone, then there is a new one."""
        self.run("ip", "addr", "del", f"{self.address}/24", "dev", "eth0")
        self.address = new
        self.run("ip", "addr", "add", f"{new}/24", "dev", "eth0")

    def resent(self) -> int:
        """Segments of TCP that this computer had to send again."""
        names, values = (
            line.split() for line in self.run("cat", "/proc/net/snmp").splitlines() if line.startswith("Tcp:")
        )
        return int(values[names.index("RetransSegs")])

    def connections_to(self, address: str) -> int:
        """How many connections of this computer lead there, as far as it knows."""
        theirs = socket.inet_aton(address)[::-1].hex().upper()
        lines = [line.split() for line in self.run("cat", "/proc/net/tcp").splitlines()[1:]]
        return sum(words[2].startswith(f"{theirs}:") and words[3] == _ESTABLISHED for words in lines)

    def kill(self) -> None:
        """The power is cut: all its processes are killed at once, and nobody is told. It has no network then.

        Its network is let go only after them, so that no connection can say goodbye.
        """
        for process in psutil.Process(self.pid).children(recursive=True):
            process.suspend()
        self.run("ip", "link", "set", "eth0", "down")
        self.end()

    def end(self) -> None:
        """Kill what is left in it."""
        if self._outer.poll() is None:
            self._outer.kill()
        self._outer.communicate()


class Network:
    """Hosts that are joined by a switch; `stack` ends them and what runs on them.

    A thread may pull cables while others use other hosts.
    """

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        users = [] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user"]
        self._switch = Host(_SWITCH, "", users)
        stack.callback(self._switch.end)
        self._switch.run("ip", "link", "add", _SWITCH, "type", "bridge", "forward_delay", "0")
        self._switch.run("ip", "link", "set", _SWITCH, "up")
        self._filter("lo", _PROGRAM.format(random=_RANDOM, below=0, pass_on=_EVER))  # can this kernel do it?
        self._hosts: list[Host] = []
        self._lock = Lock()

    def host(self, name: str, address: str = "") -> Host:
        """A new computer; `name` has 10 letters at most. It takes the next free address if none is given."""
        with self._lock:
            before = [] if os.geteuid() == 0 else self._switch.inside()
            made = Host(name, address or f"{_NET}.{len(self._hosts) + 1}", before)
            self._hosts.append(made)
            self._stack.callback(made.end)
            number = f"02:00:00:00:00:{len(self._hosts):02x}"
        port = _port_of(made)
        pid = str(made.pid)
        # From outside, where this number is that of the host's first process.
        subprocess.run(
            [
                *(*_entering(self._switch.pid), "--net", "ip", "link", "add", port),
                *("type", "veth", "peer", "name", "eth0", "netns", pid),
            ],
            check=True,
            capture_output=True,
            timeout=_TIMEOUT_S,
        )
        self._switch.run("ip", "link", "set", port, "master", _SWITCH, "up")
        made.run("ip", "addr", "add", f"{made.address}/24", "dev", "eth0")
        made.run("ip", "link", "set", "eth0", "up")
        # Announces its address as network services do; otherwise hosts that know the address by another
        # card keep sending there for up to a minute. The kernel announces it when the card's number changes.
        wait_s = _ARP_LOCK_S if address else 0
        made.run("sh", "-c", _ANNOUNCE.format(number=number, wait_s=wait_s))
        return made

    def cable(self, host: Host, *, is_in: bool) -> None:
        """Pull the cable between a host and the switch, or put it in again. The host keeps its address."""
        self._switch.run("ip", "link", "set", _port_of(host), "up" if is_in else "down")

    def lose(self, host: Host, ratio: float) -> None:
        """Lose this share of all packets to a host and from it, at random."""
        self._filter(_port_of(host), _PROGRAM.format(random=_RANDOM, below=int(ratio * _EVER), pass_on=_EVER))

    def _filter(self, device: str, program: str) -> None:
        self._switch.run("tc", "qdisc", "add", "dev", device, "clsact")
        for way in ("egress", "ingress"):
            self._switch.run("tc", "filter", "add", "dev", device, way, "bpf", "da", "bytecode", program)

    def narrow(self, host: Host, mbit: float) -> None:
        """Let no more than this through to a host in a second; 0 takes that back."""
        port = _port_of(host)
        if not mbit:
            self._switch.run("tc", "qdisc", "del", "dev", port, "root")
            return
        limits = ("rate", f"{mbit}mbit", "burst", "32kb", "latency", "200ms")
        self._switch.run("tc", "qdisc", "add", "dev", port, "root", "tbf", *limits)


def _entering(pid: int) -> list[str]:
    users = [] if os.geteuid() == 0 else ["--user", "--preserve-credentials"]
    return ["nsenter", "--target", str(pid), *users]


def _port_of(host: Host) -> str:
    return f"to-{host.name}"


@contextmanager
def network() -> Iterator[Network]:
    """A network without hosts; closed at the end. Raises `CannotMakeHostsError`."""
    if not sys.platform.startswith("linux"):
        raise CannotMakeHostsError("computers are made with Linux's namespaces")
    missing = [each for each in ("ip", "tc", "unshare", "nsenter", "setpriv") if shutil.which(each) is None]
    if missing:
        raise CannotMakeHostsError(f"these commands are missing: {', '.join(missing)}")
    with ExitStack() as stack:
        try:
            made = Network(stack)
        except subprocess.CalledProcessError as error:
            raise CannotMakeHostsError(str(error.stderr).strip()) from error
        yield made
