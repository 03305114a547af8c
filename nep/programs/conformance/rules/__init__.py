"""Rules of the native wire, one module per subject."""

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
