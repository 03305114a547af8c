"""Fixtures of a main window with plain panels on a session without a master."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow
from app.ui.theme import fonts
from app.ui.theme.theme import Theme
from tests.ui.shell_parts import PANELS, Answers, free_address


@pytest.fixture
def theme(qapp: object) -> Iterator[Theme]:
    fonts.load()
    made = Theme("light")
    yield made
    made.deleteLater()


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def session(home: Path) -> Session:
    """Session that is never started and so has no threads or sockets."""
    return Session(
        Settings(home), address=free_address(), journal_folder=home / "journal", start_processes=False
    )


@pytest.fixture
def answers() -> Answers:
    return Answers()


@pytest.fixture
def window(qtbot, theme: Theme, session: Session, answers: Answers) -> Iterator[MainWindow]:
    made = MainWindow(session, theme, PANELS, [], dialogs=answers)
    qtbot.addWidget(made)
    theme.apply()
    made.resize(1440, 900)
    yield made
    made.close()


@pytest.fixture
def commands(window: MainWindow) -> Commands:
    return window.commands
