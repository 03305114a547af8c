"""Back ends: what carries bytes between nodes. Each module binds one `BACKEND`."""
