"""Payloads that programs of one computer and user exchange through shared memory, by iceoryx2.

The socket says that a payload lies there, so order, losses and waiting stay the wire's: see docs/wire.md. A
publisher has one `SharedWriter` of some slots of one size; a subscriber has a `SharedReader` for each
publisher. Whoever cannot share memory (another computer or user, no iceoryx2, no room) uses the socket alone.
Chosen by measuring: docs/adr/0023-shared-memory.md.

What a killed program leaves is taken away by iceoryx2 when the next program of the user begins to share.
"""

from __future__ import annotations

import ctypes
import importlib
import logging
import os
import stat
import struct
import sys
import tempfile
import threading
import time
import weakref
from collections import deque
from pathlib import Path
from types import ModuleType
from typing import Any
from weakref import WeakValueDictionary

from nep.system.forks import in_child

__all__ = ["SHARED_BYTES", "Loan", "SharedReader", "SharedWriter", "begin_sharing", "can_share", "room_bytes"]

SHARED_BYTES = 32 * 2**10
"""Smaller payloads are quicker through the socket."""
_LARGEST_BYTES = 64 * 2**20
_SLOTS_BYTES = 320 * 2**20
"""So much the slots of one publisher have together; at least `_FEWEST`."""
_FEWEST, _MOST = 4, 256
_SMALLEST_BYTES = 64 * 2**10
_HELD_MOST = 12
"""Payloads of a publisher that a reader keeps where they lie; more are copied, so that slots come back."""
_HEAD = 64
"""Bytes before a payload: its number and size, and what keeps the payload aligned."""
_NUMBERS = struct.Struct("=QQ")
_COPIED_BYTES = 2**18
"""Payloads up to here that are wanted as bytes are copied when they arrive: their slots come back at once."""
_LOANS = 4
_READERS = 64
_SPARE_BYTES = 64 * 2**20
"""What stays free where shared memory lives: a program that touches a page without room there is ended."""
_ASK_S = 0.05
_ASK_BYTES = _LARGEST_BYTES
"""So long, or for so many bytes of a publisher, it is not asked again."""
_MEMORY = "/dev/shm"  # noqa: S108 - it is asked for its room, and nothing is put there by name
_MODULE = "iceoryx2"
_logger = logging.getLogger("nep")
_lock = threading.Lock()
_forks = 0
"""How many forks lie between this process and the one that loaded this module."""


class _Opened:
    """The library and this program's node there; closed with the last publisher or subscriber that has it."""

    def __init__(self) -> None:
        self.library = importlib.import_module(_MODULE)
        self.node = _new_node(self.library, _own_folder())

    def service(self, publisher: int, generation: int) -> Any:  # noqa: ANN401 - iceoryx2 has no types
        """How the memory of a publisher is made or found."""
        name = self.library.ServiceName.new(f"nep/{publisher:016x}/{generation}")
        return (
            self.node.service_builder(name)
            .publish_subscribe(self.library.Slice[ctypes.c_uint8])
            .subscriber_max_buffer_size(_MOST)
            .subscriber_max_borrowed_samples(_MOST)
            .max_publishers(1)
            .max_subscribers(_READERS)
            .max_nodes(_READERS + 1)
        )


class _Process:
    """What this process has of iceoryx2."""

    is_refused = False
    """Whether it cannot share memory at all."""
    opened: weakref.ref[_Opened] | None = None


_process = _Process()


def can_share() -> bool:
    """Whether this program may share memory, as far as is known without loading anything."""
    return not _process.is_refused and os.environ.get("NEP_SHARED_MEMORY", "") != "0"


def begin_sharing() -> object:
    """Load the library on first use, which takes a moment; None where this program cannot share memory.

    Keep what it gives as long as memory is shared.
    """
    return _open()


def _open() -> _Opened | None:
    with _lock:
        opened = None if _process.opened is None else _process.opened()
        if opened is None and can_share():
            try:
                opened = _Opened()
                _process.opened = weakref.ref(opened)
            except Exception as error:  # noqa: BLE001 - the socket does without: it must never end a program
                _process.is_refused = True
                _logger.debug("no shared memory: %s", error)
        return opened


def _new_node(library: ModuleType, folder: Path) -> Any:  # noqa: ANN401 - it has no types
    library.set_log_level(library.LogLevel.Fatal)
    configuration = library.config.default()
    configuration.global_cfg.root_path = library.Path.new(str(folder))
    configuration.global_cfg.prefix = library.FileName.new("nep_")
    builder = library.NodeBuilder.new().config(configuration)
    # Ctrl+C belongs to the program.
    builder = builder.signal_handling_mode(library.SignalHandlingMode.Disabled)
    return builder.create(library.ServiceType.Ipc)


def _own_folder() -> Path:
    """Where programs of this user find each other's memory. Raises `OSError` when that is somebody else's."""
    user = f"-{os.getuid()}" if sys.platform != "win32" else ""
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    folder = Path(runtime) / "nep-shared" if runtime else Path(tempfile.gettempdir()) / f"nep-shared{user}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or (sys.platform != "win32" and found.st_uid != os.getuid()):
        raise PermissionError(f"'{folder}' is somebody else's")
    return folder


def _keep_for_ever(*inherited: object) -> None:
    """Never let these end in a child that was forked: they would give back what is the parent's."""
    for each in inherited:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(each))


def _forked() -> None:
    """In a child, which begins anew."""
    global _lock, _forks
    _lock, _forks = threading.Lock(), _forks + 1
    opened = None if _process.opened is None else _process.opened()
    _keep_for_ever(opened, *_writers.values(), *_readers.values())
    _process.opened = None


in_child(_forked)


class _Room:
    """Whether there is room for more. Asked now and then: that takes as long as a small payload."""

    _asked_at = float("-inf")
    _left_bytes = 0

    def has(self, size_bytes: int) -> bool:
        """Whether so many bytes more may be written."""
        if sys.platform != "linux":
            return True
        now = time.monotonic()
        if now >= self._asked_at + _ASK_S or self._left_bytes < size_bytes:
            self._asked_at = now
            self._left_bytes = min(_ASK_BYTES, room_bytes() - _SPARE_BYTES)
        if self._left_bytes < size_bytes:
            return False
        self._left_bytes -= size_bytes
        return True


def room_bytes() -> int:
    """How much room there is where shared memory lives; 0 when that is not known (Linux)."""
    if sys.platform == "win32":  # whose Python knows no statvfs
        return 0
    try:
        found = os.statvfs(_MEMORY)
    except OSError:
        return 0
    return found.f_bavail * found.f_frsize


class _Slots:
    """Views of slots by their address: making one takes longer than to fill it. Valid as long as the port."""

    def __init__(self) -> None:
        self._views: dict[int, memoryview] = {}

    def view(self, address: int, size: int) -> memoryview:
        """The first `size` bytes of the slot that begins there, or more."""
        found = self._views.get(address)
        if found is None or len(found) < size:
            found = memoryview((ctypes.c_uint8 * size).from_address(address)).cast("B")
            self._views[address] = found
        return found


class Loan:
    """A slot that a payload is written into before it is sent. Given back when nobody has it any more."""

    def __init__(self, port: Any, sample: Any, size: int) -> None:  # noqa: ANN401 - iceoryx2 has no types
        self.size = size
        self._forks = _forks
        self._port = port  # the memory lasts as long as the port that it is lent by
        self._sample = sample
        self.address = int(sample.payload_ptr) + _HEAD

    @property
    def buffer(self) -> memoryview:
        """Writable, of the payload's size. Whoever has it keeps the loan."""
        array = (ctypes.c_uint8 * self.size).from_address(self.address)
        array.loan = self  # type: ignore[attr-defined]
        return memoryview(array).cast("B")

    def send(self, number: int) -> None:
        """Hand the payload to all readers. It must not be changed from now on."""
        head = (ctypes.c_uint8 * _NUMBERS.size).from_address(self.address - _HEAD)
        _NUMBERS.pack_into(head, 0, number, self.size)
        sample, self._sample = self._sample, None
        sample.assume_init().send()

    def __del__(self) -> None:
        if self._forks != _forks:
            _keep_for_ever(self._port, self._sample)


class SharedWriter:
    """The shared memory of one publisher, which guards it with its lock."""

    def __init__(self, publisher: int) -> None:
        self.generation = 0
        """Which memory readers are to open, counted from 1: a larger payload needs a larger one."""
        self.number = 0
        """Payloads sent."""
        self._publisher = publisher
        self._slot_bytes = 0
        self._room = _Room()
        self._opened: _Opened | None = None
        self._service: Any = None
        self._port: Any = None
        self._loans: WeakValueDictionary[int, Loan] = WeakValueDictionary()
        self._slots = _Slots()

    def prepare(self, size: int) -> bool:
        """Have slots for payloads of this size; whether there are. A new `generation` means new memory."""
        if size <= self._slot_bytes:
            return self._port is not None
        opened = _open() if size <= _LARGEST_BYTES else None
        if opened is None:
            return False
        slot_bytes = max(_SMALLEST_BYTES, 1 << (size - 1).bit_length())
        slots = max(_FEWEST, min(_MOST, _SLOTS_BYTES // slot_bytes))
        self.close()
        self._opened = opened
        self.generation += 1
        self._slot_bytes = slot_bytes
        try:
            service = opened.service(self._publisher, self.generation).create()
            self._port = (
                service.publisher_builder()
                .initial_max_slice_len(slot_bytes + _HEAD)
                .allocation_strategy(opened.library.AllocationStrategy.Static)
                .override_sample_preallocation(slots)
                .max_loaned_samples(_LOANS)
                .create()
            )
            self._service = service
        except Exception as error:  # noqa: BLE001 - the socket does without
            _logger.debug("no shared memory for a publisher: %s", error)
            self._port = self._service = None  # of this size: it is not tried for each message
            return False
        _writers[id(self)] = self
        return True

    def loan(self, size: int) -> Loan | None:
        """A slot; None when none is free: readers have not taken what is in them."""
        sample = self._sample(size)
        if sample is None:
            return None
        made = Loan(self._port, sample, size)
        self._loans[made.address] = made
        return made

    def _sample(self, size: int) -> Any:  # noqa: ANN401 - iceoryx2 has no types
        if self._port is None or size > self._slot_bytes or not self._room.has(size):
            return None
        try:
            return self._port.loan_slice_uninit(size + _HEAD)
        except Exception:  # noqa: BLE001 - whatever it is, the payload goes through the socket
            return None

    def copy(self, data: bytes | memoryview, size: int) -> int | None:
        """Copy a payload into a slot and hand it to the readers; its number, or None when no slot is free."""
        sample = self._sample(size)
        if sample is None:
            return None
        slot = self._slots.view(int(sample.payload_ptr), self._slot_bytes + _HEAD)
        self.number = number = self.number + 1
        _NUMBERS.pack_into(slot, 0, number, size)
        slot[_HEAD : _HEAD + size] = data if isinstance(data, bytes) else data.cast("B")
        sample.assume_init().send()
        return number

    def lent(self, data: memoryview) -> Loan | None:
        """The loan whose memory `data` is, so that it need not be copied."""
        if not self._loans or data.readonly or not data.c_contiguous:
            return None
        address = ctypes.addressof(ctypes.c_uint8.from_buffer(data))
        found = self._loans.get(address)
        return found if found is not None and found.size == data.nbytes else None

    def send(self, loan: Loan) -> int:
        """Hand it to the readers; its number, by which they find it."""
        self.number += 1
        self._loans.pop(loan.address, None)
        loan.send(self.number)
        return self.number

    def tidy(self) -> None:
        """Take slots back from readers that were killed."""
        if self._opened is not None and self._port is not None:
            self._opened.node.try_cleanup_dead_nodes()
            self._port.update_connections()

    def close(self) -> None:
        """Give it back. What readers hold stays as it is as long as they hold it."""
        self._port = self._service = self._opened = None
        self._slot_bytes = 0
        self._slots = _Slots()


class _Held:
    """Keeps a payload where it lies until nobody looks at it any more."""

    def __init__(self, sample: Any, returned: deque[None]) -> None:  # noqa: ANN401
        self._sample, self._returned = sample, returned
        self._forks = _forks

    def __del__(self) -> None:
        if self._forks != _forks:
            _keep_for_ever(self._sample)
        self._sample = None
        self._returned.append(None)


class SharedReader:
    """What a subscriber reads of one publisher's memory. Used under the subscriber's lock."""

    def __init__(self, publisher: int, generation: int) -> None:
        """Raises `LookupError` where this program cannot read that memory."""
        self._opened = _open()
        if self._opened is None:
            raise LookupError
        self.generation = generation
        self._held = 0
        self._returned: deque[None] = deque()
        self._ahead: tuple[int, int, Any] | None = None
        self._slots = _Slots()
        try:
            self._service = self._opened.service(publisher, generation).open()
            self._port = self._service.subscriber_builder().buffer_size(_MOST).create()
        except Exception as error:
            raise LookupError from error
        _readers[id(self)] = self

    def take(self, number: int, *, may_copy: bool = False) -> bytes | memoryview | None:
        """The payload of this number, read-only; None when it was overwritten before it was read.

        With `may_copy` small ones are copied out of their slot.
        """
        while True:
            found, self._ahead = self._ahead or self._next(), None
            if found is None:
                return None
            if found[0] == number:
                return self._payload(*found[1:], may_copy=may_copy)
            if found[0] > number:
                self._ahead = found
                return None

    def _next(self) -> tuple[int, int, Any] | None:
        """The number of the next one, its size, and where it lies."""
        try:
            sample = self._port.receive()
        except Exception as error:  # noqa: BLE001 - it counts as lost
            _logger.debug("a payload in shared memory was not read: %s", error)
            return None
        if sample is None:
            return None
        number, size = _NUMBERS.unpack_from(self._slots.view(int(sample.payload_ptr), _NUMBERS.size))
        return number, size, sample

    def _payload(self, size: int, sample: Any, *, may_copy: bool) -> bytes | memoryview:  # noqa: ANN401
        address = int(sample.payload_ptr)
        if may_copy and size <= _COPIED_BYTES:
            return bytes(self._slots.view(address, size + _HEAD)[_HEAD : _HEAD + size])
        array = (ctypes.c_uint8 * size).from_address(address + _HEAD)
        while self._returned:
            self._returned.popleft()
            self._held -= 1
        if self._held >= _HELD_MOST:
            return memoryview(bytes(array))
        self._held += 1
        array.held = _Held(sample, self._returned)  # type: ignore[attr-defined]
        return memoryview(array).cast("B").toreadonly()


_writers: WeakValueDictionary[int, SharedWriter] = WeakValueDictionary()
_readers: WeakValueDictionary[int, SharedReader] = WeakValueDictionary()
