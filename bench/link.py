"""Two network namespaces connected by a link with the delay, jitter and rate of Wi-Fi.

This process must run in its own network namespace (`unshare -rn`); the other one is created. With the
kernel's netem, the link is a veth pair. Without netem, a process forwards IP packets between TUN
devices of both namespaces after their delay. Programs see an ordinary TCP network and need no options.

    python bench/link.py DELAY_MS JITTER_MS RATE_MBIT       run the forwarding process
"""

from __future__ import annotations

import fcntl
import json
import os
import random
import select
import shutil
import signal
import statistics
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

__all__ = ["HOSTS", "Link", "Wifi", "joined", "why_no_networks"]

HOSTS = ("10.77.0.1", "10.77.0.2")
OWN, OTHER = "nep-own", "nep-other"
MTU = 1500
QUEUE = 1000
"""Maximum number of packets queued at each end of the link, as in netem; further packets are dropped."""
TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000


@dataclass(frozen=True)
class Wifi:
    """Delay, jitter and rate of one direction."""

    delay_ms: float = 1.0
    jitter_ms: float = 0.3
    rate_mbit: float = 50.0


@dataclass
class Link:
    """Active link: its implementation, and the command prefix that runs a program at the other end."""

    made_by: str
    elsewhere: tuple[str, ...]
    told: dict[str, float] = field(default_factory=dict)
    """Statistics that the forwarding process prints at its end."""


class LinkError(Exception):
    """Reason why the link could not be created."""


def why_no_networks() -> str:
    """Return why network namespaces are unavailable, or ""."""
    missing = [each for each in ("unshare", "nsenter", "ip") if shutil.which(each) is None]
    if missing:
        return f"networks of their own need {', '.join(missing)} (Linux: util-linux, iproute2)"
    done = subprocess.run(["unshare", "-rn", "true"], capture_output=True, text=True, check=False)
    return f"networks of their own cannot be made: {done.stderr.strip()[:200]}" if done.returncode else ""


@contextmanager
def joined(wifi: Wifi) -> Iterator[Link]:
    """Context manager of the link, for a process in its own network namespace. Raises `LinkError`."""
    with ExitStack() as stack:
        # The other namespace exists while a process runs in it; `cat` ends with its standard input.
        holder = subprocess.Popen(["unshare", "-n", "cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        stack.callback(holder.wait)
        assert holder.stdin is not None
        assert holder.stdout is not None
        stack.callback(holder.stdout.close)
        stack.callback(holder.stdin.close)
        holder.stdin.write(b"up\n")
        holder.stdin.flush()
        holder.stdout.readline()  # `cat` replies only after `unshare` has entered the namespace
        link = Link("netem", ("nsenter", "-n", "-t", str(holder.pid), "--"))
        why_no_netem = by_netem(wifi, holder.pid, link)
        if why_no_netem:
            link.made_by = f"a process of ours, as netem is not there ({why_no_netem})"
            stack.enter_context(by_process(wifi, holder.pid, link))
        for number, (name, before) in enumerate(((OWN, ()), (OTHER, link.elsewhere))):
            run(*before, "ip", "link", "set", "lo", "up")
            run(*before, "ip", "addr", "add", f"{HOSTS[number]}/24", "dev", name)
            run(*before, "ip", "link", "set", name, "mtu", str(MTU), "up")
        yield link


def run(*command: str) -> None:
    """Run a command; raise `LinkError` with its error output if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise LinkError(f"'{' '.join(command)}' failed: {done.stderr.strip()[:200]}")


def by_netem(wifi: Wifi, other_pid: int, link: Link) -> str:
    """Create a veth pair with netem; return why netem is unavailable, or "". Raises `LinkError`."""
    if shutil.which("tc") is None:
        return "there is no 'tc'"
    run("ip", "link", "add", OWN, "type", "veth", "peer", "name", OTHER, "netns", str(other_pid))
    qdisc = f"root netem delay {wifi.delay_ms}ms {wifi.jitter_ms}ms rate {wifi.rate_mbit}mbit".split()
    try:
        run("tc", "qdisc", "add", "dev", OWN, *qdisc)
        run(*link.elsewhere, "tc", "qdisc", "add", "dev", OTHER, *qdisc)
    except LinkError as error:
        run("ip", "link", "del", OWN)
        return str(error).partition(" failed: ")[2]
    return ""


@contextmanager
def by_process(wifi: Wifi, other_pid: int, link: Link) -> Iterator[None]:
    """Context manager of a forwarding process, which ends with its standard input. Raises `LinkError`."""
    command = [sys.executable, __file__, *map(str, (wifi.delay_ms, wifi.jitter_ms, wifi.rate_mbit))]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            said = process.stdout.readline().strip()
            if said != "up":
                raise LinkError(said or "the process that is the link has ended")
            run("ip", "link", "set", OTHER, "netns", str(other_pid))
            yield
        finally:
            process.stdin.close()
            last = process.stdout.readline()
            link.told = json.loads(last) if last.startswith("{") else {}


# ---- link process ---------------------------------------------------------------------------------


def tun(name: str) -> int:
    """Open a TUN device for raw IP packets and return its file descriptor."""
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH14x", name.encode(), IFF_TUN | IFF_NO_PI))
    return device


class Way:
    """One direction of the link: packets in order, delayed by rate, delay and jitter."""

    def __init__(self, wifi: Wifi, source: int, target: int) -> None:
        self.source, self._target = source, target
        self._delay_s, self._jitter_s = wifi.delay_ms / 1e3, wifi.jitter_ms / 1e3
        self._byte_s = 8 / (wifi.rate_mbit * 1e6)
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._is_sent = self._arrives = 0.0
        self.packets = self.dropped = 0
        self.late: deque[float] = deque(maxlen=100_000)

    def read(self, now: float) -> None:
        """Read and queue all available packets."""
        while True:
            try:
                packet = os.read(self.source, 1 << 16)
            except BlockingIOError:
                return
            self.packets += 1
            if len(self._waiting) >= QUEUE:
                self.dropped += 1
                continue
            self._is_sent = max(now, self._is_sent) + len(packet) * self._byte_s
            delay_s = max(0.0, random.gauss(self._delay_s, self._jitter_s))
            self._arrives = max(self._arrives, self._is_sent + delay_s)
            self._waiting.append((self._arrives, packet))

    def deliver(self, now: float) -> float:
        """Write the packets that are due; return the time at which the next one is due."""
        while self._waiting and self._waiting[0][0] <= now:
            due, packet = self._waiting.popleft()
            self.late.append(now - due)
            try:
                os.write(self._target, packet)
            except OSError:
                self.dropped += 1  # the interface at that end is down
        return self._waiting[0][0] if self._waiting else now + 1.0


def main() -> int:
    """Forward packets until standard input ends, then print statistics."""
    wifi = Wifi(*map(float, sys.argv[1:4]))
    try:
        own, other = tun(OWN), tun(OTHER)
    except OSError as error:
        print(f"there is no TUN device: {error.strerror}", flush=True)
        return 1
    ways = {own: Way(wifi, own, other), other: Way(wifi, other, own)}
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is handled by the parent process
    print("up", flush=True)
    end = sys.stdin.fileno()
    while True:
        now = time.monotonic()
        due = min(way.deliver(now) for way in ways.values())
        readable, _, _ = select.select([*ways, end], [], [], max(0.0, due - time.monotonic()))
        if end in readable:
            break
        for source in readable:
            ways[source].read(time.monotonic())
    late = sorted(each for way in ways.values() for each in way.late)
    told = {
        "packets": sum(way.packets for way in ways.values()),
        "dropped": sum(way.dropped for way in ways.values()),
        "late_p95_ms": statistics.quantiles(late, n=20)[-1] * 1e3 if len(late) > 1 else 0.0,
    }
    print(json.dumps(told), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
