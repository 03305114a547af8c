"""Recordings of messages in MCAP files. See docs/recordings.md.

    Record:   with RecordingWriter(path) as writer, Recorder(node, writer, TopicSelection(("/arm/*",))): ...
              in a separate process: `nep.recordings.child`; flight recorder: `FlightRecorder`
    Read:     with Recording(path) as recording: for log_ns, message in recording.read(start_ns): ...
              `newest` to seek, `densities` for a timeline, `stats` for message counts and losses, `entries`
              for the recorder's own entries
    Play:     Player(Playback(recording), sink)
    Repair:   repair(path)
    Export:   export(recording, "csv", folder)

These names are in the modules `writer`, `recorder`, `ring`, `reader`, `player`, `repair` and `export`. The
packages of `nep-studio[recordings]` are imported when a recording is opened or created; if they are missing,
`RecordingsUnavailableError` is raised.
"""
