"""Parts of a session that connect other packages with each other; see `app.core.world.part.SessionPart`."""
