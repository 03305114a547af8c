"""Large payloads through shared memory on one computer, see docs/adr/0023-shared-memory.md."""
