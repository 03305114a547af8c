"""Hosts of a test: network and process namespaces that are connected by a switch.

No host has a name in the system that could conflict or remain: a namespace exists as long as a process
in it. The first process of each host reads its standard input. When this program ends, also by
`kill -9`, that input is closed, the first process ends, and the kernel kills all other processes in the
namespace.

A user who is not root also gets a user namespace, where the system allows it.
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

_TIMEOUT_S = 60.0
_SWITCH = "switch"
_NET = "10.88.0"
_FIRST = "mount -t tmpfs tmpfs /dev/shm; ip link set lo up; hostname {name}; echo; exec cat"
"""First process of a host, with its own /dev/shm: shared memory must not reach other hosts."""
_ANNOUNCE = (
    "sleep {wait_s}; echo 1 > /proc/sys/net/ipv4/conf/eth0/arp_notify; ip link set eth0 address {number}"
)
_ARP_LOCK_S = 1.1
"""Seconds that hosts ignore an announcement of an address they have just learned (`locktime`: 1 s)."""
_ESTABLISHED = "01"
_RANDOM, _EVER = 0xFFFFF038, 2**32 - 1
_PROGRAM = "4,32 0 0 {random},37 1 0 {below},6 0 0 2,6 0 0 {pass_on},"
"""BPF program of the kernel's packet filter: drops a packet whose random number is below the bound."""


class CannotMakeHostsError(Exception):
    """Error for a computer without a required command or without namespaces for this user."""


class Host:
    """Simulated host. `address` is its IPv4 address; its processes are killed when it ends."""

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
        """Return the command prefix that starts a program on this host and kills it with its parent."""
        enter = [*_entering(self.pid), "--net", "--pid", "--mount", "--uts"]
        return [*enter, "setpriv", "--pdeathsig", "KILL"]

    def run(self, *words: str) -> str:
        """Run a command on this host and return its output.

        Raises:
            subprocess.CalledProcessError: If the command fails.
        """
        done = subprocess.run(
            [*self.inside(), *words], check=True, capture_output=True, text=True, timeout=_TIMEOUT_S
        )
        return done.stdout

    def change_address(self, new: str) -> None:
        """Replace the address, as a change of the Wi-Fi network does: the old one is removed first."""
        self.run("ip", "addr", "del", f"{self.address}/24", "dev", "eth0")
        self.address = new
        self.run("ip", "addr", "add", f"{new}/24", "dev", "eth0")

    def resent(self) -> int:
        """Return the number of TCP segments that this host has retransmitted."""
        names, values = (
            line.split() for line in self.run("cat", "/proc/net/snmp").splitlines() if line.startswith("Tcp:")
        )
        return int(values[names.index("RetransSegs")])

    def connections_to(self, address: str) -> int:
        """Return the number of established connections to an address in this host's kernel."""
        theirs = socket.inet_aton(address)[::-1].hex().upper()
        lines = [line.split() for line in self.run("cat", "/proc/net/tcp").splitlines()[1:]]
        return sum(words[2].startswith(f"{theirs}:") and words[3] == _ESTABLISHED for words in lines)

    def kill(self) -> None:
        """Simulate a power failure: kill all processes at once, without a message to other hosts.

        The processes are suspended before the network goes down, so no connection is closed properly.
        """
        for process in psutil.Process(self.pid).children(recursive=True):
            process.suspend()
        self.run("ip", "link", "set", "eth0", "down")
        self.end()

    def end(self) -> None:
        """Kill the remaining processes."""
        if self._outer.poll() is None:
            self._outer.kill()
        self._outer.communicate()


class Network:
    """Hosts connected by a switch; `stack` ends the hosts and their programs.

    A thread may disconnect cables while other threads use other hosts.
    """

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        users = [] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user"]
        self._switch = Host(_SWITCH, "", users)
        stack.callback(self._switch.end)
        self._switch.run("ip", "link", "add", _SWITCH, "type", "bridge", "forward_delay", "0")
        self._switch.run("ip", "link", "set", _SWITCH, "up")
        self._filter("lo", _PROGRAM.format(random=_RANDOM, below=0, pass_on=_EVER))  # checks kernel support
        self._hosts: list[Host] = []
        self._lock = Lock()

    def host(self, name: str, address: str = "") -> Host:
        """Add a host; ``name`` has at most 10 letters, and ``address`` "" means the next free one."""
        with self._lock:
            before = [] if os.geteuid() == 0 else self._switch.inside()
            made = Host(name, address or f"{_NET}.{len(self._hosts) + 1}", before)
            self._hosts.append(made)
            self._stack.callback(made.end)
            number = f"02:00:00:00:00:{len(self._hosts):02x}"
        port = _port_of(made)
        pid = str(made.pid)
        # Run outside the host's PID namespace, where `pid` is the number of its first process.
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
        # Announce the address (gratuitous ARP), as network services do; hosts that cached another card's
        # MAC address would use it for up to a minute. The kernel announces only changes of the MAC address.
        wait_s = _ARP_LOCK_S if address else 0
        made.run("sh", "-c", _ANNOUNCE.format(number=number, wait_s=wait_s))
        return made

    def cable(self, host: Host, *, is_in: bool) -> None:
        """Connect or disconnect the cable between a host and the switch. The host keeps its address."""
        self._switch.run("ip", "link", "set", _port_of(host), "up" if is_in else "down")

    def lose(self, host: Host, ratio: float) -> None:
        """Drop this share (0 to 1) of all packets to and from a host, at random."""
        self._filter(_port_of(host), _PROGRAM.format(random=_RANDOM, below=int(ratio * _EVER), pass_on=_EVER))

    def _filter(self, device: str, program: str) -> None:
        self._switch.run("tc", "qdisc", "add", "dev", device, "clsact")
        for way in ("egress", "ingress"):
            self._switch.run("tc", "filter", "add", "dev", device, way, "bpf", "da", "bytecode", program)

    def narrow(self, host: Host, mbit: float) -> None:
        """Limit the bandwidth to a host, in Mbit/s; 0 removes the limit."""
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
    """Yield a network without hosts and close it at the end.

    Raises:
        CannotMakeHostsError: If this computer lacks a required command or namespaces.
    """
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
