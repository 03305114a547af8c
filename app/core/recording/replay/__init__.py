"""Replay: a recording as a source of topics and messages, beside the live network. Sends nothing."""
