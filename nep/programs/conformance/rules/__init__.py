"""The rules: each module registers some."""

from nep.programs.conformance.rules import (  # noqa: F401 - importing them registers the rules
    closing,
    connections,
    handshake,
    lease,
    limits,
    losses,
    messages,
    receiving,
    registration,
    services,
)
