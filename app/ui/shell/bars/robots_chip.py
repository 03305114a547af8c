"""The chip of the app bar: which robots there are, and how they are."""

from __future__ import annotations

from app.core.session import Session

WORDS = {"ready": "ready", "busy": "moving", "away": "away"}


def robots_chip(session: Session) -> tuple[str, str]:
    """Words and status: "Pepper ready", "2 robots", "Camera silent", "No robot"."""
    links = [link for link in session.fleet.links if link.state != "away"]
    if not links:
        return "No robot", "off"
    moving = [link for link in links if link.state == "not stopped"]
    if moving:
        others = f" and {len(moving) - 1} more" if len(moving) > 1 else ""
        return f"{moving[0].name}{others}: {moving[0].chip.removeprefix('virtual, ')}", "error"
    stopping = [link for link in links if link.state == "stopping"]
    if stopping:
        return f"{stopping[0].name if len(stopping) == 1 else f'{len(stopping)} robots'} stopping", "running"
    silent = [link for link in links if link.state == "silent"]
    if silent:
        words = silent[0].silent or "silent"
        if len(silent) > 1:
            return f"{len(silent)} robots silent", "error"
        return (f"{silent[0].name}: {words}" if len(links) > 1 else words[:1].upper() + words[1:]), "error"
    if len(links) > 1:
        return f"{len(links)} robots", "ok"
    return f"{links[0].name} {_doing(session, links[0].state)}", "ok"


def _doing(session: Session, state: str) -> str:
    """What the only robot does, for its program or for a person."""
    if not session.runs.active:
        return WORDS[state]
    return "holds still" if session.runs.view().state == "paused" else "running"
