"""Recordings: what robots and programs said, in MCAP files, as it was received. See docs/recordings.md.

Record:   with RecordingWriter(path) as writer, Recorder(node, writer, TopicSelection(("/arm/*",))): ...
          the same in a process of its own: `nep.recordings.child`; the last minute, always: `FlightRecorder`
Read:     with Recording(path) as recording: for log_ns, message in recording.read(start_ns, topics=...): ...
          `newest` for a seek, `densities` for a timeline, `figures` of what was lost, `said` by the recorder
Play:     Player(Playback(recording), sink)
Mend:     repair(path); tables and pictures: export(recording, "csv", folder)

Each is in the module of its name. They need the packages of `nep-studio[recordings]`, which are imported when
a recording is opened or made: without them that raises `RecordingsUnavailableError`.
"""
