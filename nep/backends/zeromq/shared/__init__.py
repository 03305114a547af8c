"""Transfer of large payloads through shared memory on one computer. See docs/adr/0023-shared-memory.md."""
