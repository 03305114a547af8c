"""Recordings: what robots and programs said, in MCAP files, as it was received. See docs/recordings.md.

    with RecordingWriter(path) as writer:       writer.post(messages)      (any thread; never waits)
    with Recording(path) as recording:          for item in recording.read(start_ns): item.message
    repair(damaged, mended)                     what is whole in a cut or damaged file, in a new one

Needs the packages of `nep-studio[recordings]`; nothing of them is imported before this package is.
"""

from nep.errors import RecordingsUnavailableError

try:
    import lz4.frame  # type: ignore[import-untyped]  # noqa: F401 - whether it is there
    import mcap.records  # noqa: F401
    import zstandard  # noqa: F401
except ImportError as error:
    raise RecordingsUnavailableError("pip install 'nep-studio[recordings]'") from error
