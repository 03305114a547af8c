"""Shared memory for payloads between programs of one computer and user, over iceoryx2.

The socket still transfers a message per payload, so order, losses and waiting are the same as without
shared memory; see docs/wire.md. A publisher has one `SharedWriter` with slots of one size; a subscriber
has one `SharedReader` per publisher. Programs that can't share memory (another computer or user,
iceoryx2 missing, memory full) use only the socket. Measurements: docs/adr/0023-shared-memory.md.

iceoryx2 releases the resources of a killed program when another program of the user starts to share
memory.
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

from nep.system.forks import call_in_child, current_generation, prevent_finalization

MIN_SHARED_BYTES = 32 * 2**10
"""Payload size in bytes from which shared memory is faster than the socket."""
_MAX_PAYLOAD_BYTES = 64 * 2**20
_TOTAL_SLOT_BYTES = 320 * 2**20
"""Target for the total size of a publisher's slots in bytes. At least `_MIN_SLOTS` are created."""
_MIN_SLOTS, _MAX_SLOTS = 4, 256
_MIN_SLOT_BYTES = 64 * 2**10
_MAX_HELD_SLOTS = 12
"""Maximum number of a publisher's payloads that a reader uses in place; further payloads are copied."""
_HEADER_BYTES = 64
"""Size in bytes of the header before a payload: number, size, and padding for alignment."""
_HEADER = struct.Struct("=QQ")
_MAX_COPIED_BYTES = 2**18
"""Maximum size in bytes of payloads that are copied on arrival if bytes are requested.

Copying frees the slot early.
"""
_MAX_LOANS = 4
_MAX_READERS = 64
_RESERVED_BYTES = 64 * 2**20
"""Minimum free space in bytes of the shared-memory file system.

Writing without free space would kill the program.
"""
_QUERY_INTERVAL_S = 0.05
_QUERY_INTERVAL_BYTES = _MAX_PAYLOAD_BYTES
"""Number of bytes that a publisher may write before it queries the free space again.

The free space is also queried after `_QUERY_INTERVAL_S`.
"""
_SHARED_MEMORY_FOLDER = "/dev/shm"  # noqa: S108 - only queried for free space; no file is created by name
_MODULE_NAME = "iceoryx2"
_logger = logging.getLogger("nep")
_lock = threading.Lock()


class _IceoryxNode:
    def __init__(self) -> None:
        self.library = importlib.import_module(_MODULE_NAME)
        self.node = _new_node(self.library, _create_private_folder())

    def service(self, publisher: int, generation: int) -> Any:  # noqa: ANN401 - iceoryx2 is not typed
        name = self.library.ServiceName.new(f"nep/{publisher:016x}/{generation}")
        return (
            self.node.service_builder(name)
            .publish_subscribe(self.library.Slice[ctypes.c_uint8])
            .subscriber_max_buffer_size(_MAX_SLOTS)
            .subscriber_max_borrowed_samples(_MAX_SLOTS)
            .max_publishers(1)
            .max_subscribers(_MAX_READERS)
            .max_nodes(_MAX_READERS + 1)
        )


class _ProcessState:
    # State of this process. `is_unavailable` is True if shared memory is unavailable.
    is_unavailable = False
    node_ref: weakref.ref[_IceoryxNode] | None = None


_process = _ProcessState()


def can_share() -> bool:
    """Return True if this program can probably share memory. Doesn't load iceoryx2 to find out."""
    return not _process.is_unavailable and os.environ.get("NEP_SHARED_MEMORY", "") != "0"


def start_sharing() -> object:
    """Load iceoryx2, which takes long the first time.

    Returns:
        An object that must be referenced while memory is shared; None if iceoryx2 is unavailable.
    """
    return _open_node()


def _open_node() -> _IceoryxNode | None:
    with _lock:
        iceoryx_node = None if _process.node_ref is None else _process.node_ref()
        if iceoryx_node is None and can_share():
            try:
                iceoryx_node = _IceoryxNode()
                _process.node_ref = weakref.ref(iceoryx_node)
            except Exception as error:  # noqa: BLE001 - the socket works without it: this must never end a program
                _process.is_unavailable = True
                _logger.debug("no shared memory: %s", error)
        return iceoryx_node


def _new_node(library: ModuleType, folder: Path) -> Any:  # noqa: ANN401 - not typed
    library.set_log_level(library.LogLevel.Fatal)
    configuration = library.config.default()
    configuration.global_cfg.root_path = library.Path.new(str(folder))
    configuration.global_cfg.prefix = library.FileName.new("nep_")
    builder = library.NodeBuilder.new().config(configuration)
    # the program handles Ctrl+C itself
    builder = builder.signal_handling_mode(library.SignalHandlingMode.Disabled)
    return builder.create(library.ServiceType.Ipc)


def _create_private_folder() -> Path:
    # Raises `OSError` if the folder belongs to another user.
    user = f"-{os.getuid()}" if sys.platform != "win32" else ""
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    folder = Path(runtime) / "nep-shared" if runtime else Path(tempfile.gettempdir()) / f"nep-shared{user}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder_stat = folder.lstat()
    if not stat.S_ISDIR(folder_stat.st_mode) or (
        sys.platform != "win32" and folder_stat.st_uid != os.getuid()
    ):
        raise PermissionError(f"'{folder}' belongs to another user")
    return folder


def _forked() -> None:
    # Called in the forked child process, which starts from scratch.
    global _lock  # noqa: PLW0603 - one per process
    _lock = threading.Lock()
    iceoryx_node = None if _process.node_ref is None else _process.node_ref()
    prevent_finalization(iceoryx_node, *_writers.values(), *_readers.values())
    _process.node_ref = None


call_in_child(_forked)


class _FreeSpace:
    # Free space, queried at intervals: a query takes as long as a small payload.
    _queried_at = float("-inf")
    _remaining_bytes = 0

    def reserve(self, size_bytes: int) -> bool:
        if sys.platform != "linux":
            return True
        now = time.monotonic()
        if now >= self._queried_at + _QUERY_INTERVAL_S or self._remaining_bytes < size_bytes:
            self._queried_at = now
            self._remaining_bytes = min(_QUERY_INTERVAL_BYTES, free_bytes() - _RESERVED_BYTES)
        if self._remaining_bytes < size_bytes:
            return False
        self._remaining_bytes -= size_bytes
        return True


def free_bytes() -> int:
    """Return the number of free bytes in the shared-memory file system; 0 if unknown."""
    if sys.platform == "win32":  # Python on Windows has no statvfs
        return 0
    try:
        stats = os.statvfs(_SHARED_MEMORY_FOLDER)
    except OSError:
        return 0
    return stats.f_bavail * stats.f_frsize


class _SlotViews:
    # Cache of views by slot address: creating a view takes longer than filling it. Valid while the port
    # exists.
    def __init__(self) -> None:
        self._views: dict[int, memoryview] = {}

    def view(self, address: int, size: int) -> memoryview:
        slot_view = self._views.get(address)
        if slot_view is None or len(slot_view) < size:
            slot_view = memoryview((ctypes.c_uint8 * size).from_address(address)).cast("B")
            self._views[address] = slot_view
        return slot_view


class Loan:
    """Slot into which a payload is written before being published.

    The slot is released with the last reference to the object.
    """

    def __init__(self, port: Any, sample: Any, size: int) -> None:  # noqa: ANN401 - iceoryx2 is not typed
        self.size = size
        self._generation = current_generation()
        self._port = port  # the memory is valid while the port exists
        self._sample = sample
        self.address = int(sample.payload_ptr) + _HEADER_BYTES

    @property
    def buffer(self) -> memoryview:
        """Writable buffer with the size of the payload. References the loan, so that the slot stays valid."""
        array = (ctypes.c_uint8 * self.size).from_address(self.address)
        array.loan = self  # type: ignore[attr-defined]
        return memoryview(array).cast("B")

    def send(self, number: int) -> None:
        """Publish the payload to all readers as payload `number`. It must not be changed afterwards."""
        header = (ctypes.c_uint8 * _HEADER.size).from_address(self.address - _HEADER_BYTES)
        _HEADER.pack_into(header, 0, number, self.size)
        sample, self._sample = self._sample, None
        sample.assume_init().send()

    def __del__(self) -> None:
        if self._generation.is_inherited:
            prevent_finalization(self._port, self._sample)


class SharedWriter:
    """Shared memory of one publisher. Guarded by the publisher's lock."""

    def __init__(self, publisher: int) -> None:
        self.generation = 0
        """Number of the memory segment that readers must open, from 1; larger payloads need a new segment."""
        self.number = 0
        """Number of payloads sent."""
        self._publisher = publisher
        self._slot_bytes = 0
        self._free_space = _FreeSpace()
        self._iceoryx_node: _IceoryxNode | None = None
        self._service: Any = None
        self._port: Any = None
        self._loans: WeakValueDictionary[int, Loan] = WeakValueDictionary()
        self._slots = _SlotViews()

    def prepare(self, size: int) -> bool:
        """Create slots for payloads of `size` bytes if needed; return False if that is impossible.

        New slots start a new `generation`.
        """
        if size <= self._slot_bytes:
            return self._port is not None
        iceoryx_node = _open_node() if size <= _MAX_PAYLOAD_BYTES else None
        if iceoryx_node is None:
            return False
        slot_bytes = max(_MIN_SLOT_BYTES, 1 << (size - 1).bit_length())
        slot_count = max(_MIN_SLOTS, min(_MAX_SLOTS, _TOTAL_SLOT_BYTES // slot_bytes))
        self.close()
        self._iceoryx_node = iceoryx_node
        self.generation += 1
        self._slot_bytes = slot_bytes
        try:
            service = iceoryx_node.service(self._publisher, self.generation).create()
            self._port = (
                service.publisher_builder()
                .initial_max_slice_len(slot_bytes + _HEADER_BYTES)
                .allocation_strategy(iceoryx_node.library.AllocationStrategy.Static)
                .override_sample_preallocation(slot_count)
                .max_loaned_samples(_MAX_LOANS)
                .create()
            )
            self._service = service
        except Exception as error:  # noqa: BLE001 - the socket works without it
            _logger.debug("no shared memory for a publisher: %s", error)
            self._port = self._service = None  # don't retry for each message of this size
            return False
        _writers[id(self)] = self
        return True

    def loan(self, size: int) -> Loan | None:
        """Return a free slot for `size` bytes.

        Returns None if no slot is free, the slots are smaller than `size`, or the shared memory is
        full.
        """
        sample = self._loan_sample(size)
        if sample is None:
            return None
        loan = Loan(self._port, sample, size)
        self._loans[loan.address] = loan
        return loan

    def _loan_sample(self, size: int) -> Any:  # noqa: ANN401 - iceoryx2 is not typed
        if self._port is None or size > self._slot_bytes or not self._free_space.reserve(size):
            return None
        try:
            return self._port.loan_slice_uninit(size + _HEADER_BYTES)
        except Exception:  # noqa: BLE001 - on any error the payload goes through the socket
            return None

    def copy(self, data: bytes | memoryview, size: int) -> int | None:
        """Copy a payload into a slot and publish it to the readers.

        Returns:
            The number of the payload; None if no slot is free, the slots are too small, or the shared
            memory is full.
        """
        sample = self._loan_sample(size)
        if sample is None:
            return None
        slot = self._slots.view(int(sample.payload_ptr), self._slot_bytes + _HEADER_BYTES)
        self.number = number = self.number + 1
        _HEADER.pack_into(slot, 0, number, size)
        slot[_HEADER_BYTES : _HEADER_BYTES + size] = data if isinstance(data, bytes) else data.cast("B")
        sample.assume_init().send()
        return number

    def find_loan(self, data: memoryview) -> Loan | None:
        """Return the loan whose buffer is `data`, or None if there is none."""
        if not self._loans or data.readonly or not data.c_contiguous:
            return None
        address = ctypes.addressof(ctypes.c_uint8.from_buffer(data))
        loan = self._loans.get(address)
        return loan if loan is not None and loan.size == data.nbytes else None

    def send(self, loan: Loan) -> int:
        """Publish the payload of a loan to the readers; return the number of the payload."""
        self.number += 1
        self._loans.pop(loan.address, None)
        loan.send(self.number)
        return self.number

    def reclaim_slots(self) -> None:
        """Reclaim the slots of readers whose processes were killed."""
        if self._iceoryx_node is not None and self._port is not None:
            self._iceoryx_node.node.try_cleanup_dead_nodes()
            self._port.update_connections()

    def close(self) -> None:
        """Release the memory. Payloads that readers still use remain valid."""
        self._port = self._service = self._iceoryx_node = None
        self._slot_bytes = 0
        self._slots = _SlotViews()


class _HeldSample:
    # Keeps a payload in its slot until its last view is released, which is recorded in `releases`.
    def __init__(self, sample: Any, releases: deque[None]) -> None:  # noqa: ANN401
        self._sample, self._releases = sample, releases
        self._generation = current_generation()

    def __del__(self) -> None:
        if self._generation.is_inherited:
            prevent_finalization(self._sample)
        self._sample = None
        self._releases.append(None)


class SharedReader:
    """Shared memory of one publisher, opened for a subscriber. Guarded by the subscriber's lock."""

    def __init__(self, publisher: int, generation: int) -> None:
        """Open the shared memory of a publisher.

        Args:
            publisher: Id of the publisher.
            generation: Number of the memory segment, see `SharedWriter.generation`.

        Raises:
            LookupError: The memory can't be opened by this program.
        """
        self._iceoryx_node = _open_node()
        if self._iceoryx_node is None:
            raise LookupError
        self.generation = generation
        self._held_slots = 0
        self._releases: deque[None] = deque()
        self._next_sample: tuple[int, int, Any] | None = None
        self._slots = _SlotViews()
        try:
            self._service = self._iceoryx_node.service(publisher, generation).open()
            self._port = self._service.subscriber_builder().buffer_size(_MAX_SLOTS).create()
        except Exception as error:
            raise LookupError from error
        _readers[id(self)] = self

    def read(self, number: int, *, may_copy: bool = False) -> bytes | memoryview | None:
        """Return a payload as a read-only buffer, or None if it was overwritten or isn't available.

        Args:
            number: Number of the payload, see `SharedWriter.number`.
            may_copy: True to copy small payloads, which frees their slots.
        """
        while True:
            sample, self._next_sample = self._next_sample or self._receive_next(), None
            if sample is None:
                return None
            if sample[0] == number:
                return self._extract_payload(*sample[1:], may_copy=may_copy)
            if sample[0] > number:
                self._next_sample = sample
                return None

    def _receive_next(self) -> tuple[int, int, Any] | None:
        try:
            sample = self._port.receive()
        except Exception as error:  # noqa: BLE001 - counts as lost
            _logger.debug("can't read a payload from shared memory: %s", error)
            return None
        if sample is None:
            return None
        sample_bytes = sample.header.number_of_elements
        if sample_bytes < _HEADER_BYTES:
            return None
        number, size = _HEADER.unpack_from(self._slots.view(int(sample.payload_ptr), _HEADER.size))
        # a larger size would read beyond the memory, which ends the program
        return (number, size, sample) if size <= sample_bytes - _HEADER_BYTES else None

    def _extract_payload(self, size: int, sample: Any, *, may_copy: bool) -> bytes | memoryview:  # noqa: ANN401
        address = int(sample.payload_ptr)
        if may_copy and size <= _MAX_COPIED_BYTES:
            return bytes(
                self._slots.view(address, size + _HEADER_BYTES)[_HEADER_BYTES : _HEADER_BYTES + size]
            )
        array = (ctypes.c_uint8 * size).from_address(address + _HEADER_BYTES)
        while self._releases:
            self._releases.popleft()
            self._held_slots -= 1
        if self._held_slots >= _MAX_HELD_SLOTS:
            return memoryview(bytes(array))
        self._held_slots += 1
        array.held = _HeldSample(sample, self._releases)  # type: ignore[attr-defined]
        return memoryview(array).cast("B").toreadonly()


_writers: WeakValueDictionary[int, SharedWriter] = WeakValueDictionary()
_readers: WeakValueDictionary[int, SharedReader] = WeakValueDictionary()
