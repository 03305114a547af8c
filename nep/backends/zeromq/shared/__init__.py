"""Large payloads through memory that programs of one computer share: see docs/adr/0023-shared-memory.md."""
