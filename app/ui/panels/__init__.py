"""The panels of Studio: each module binds one ``PANEL``; a new one is one new file."""
