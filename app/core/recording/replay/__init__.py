"""Replay of a recording: a source of topics and messages, next to the live network.

A replay publishes nothing on the live network, unless the user arms
`app.core.recording.replay.sending`.
"""
