"""Images of the blocks, saved as PNG or SVG, or copied to the clipboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtGui import QGuiApplication, QImage

from app.core.projects.open_project import OpenProject
from app.core.storage.atomic_file import write_atomically
from app.core.storage.folders import closed_tabs_folder
from app.ui.blockly.messages import PictureKind
from app.ui.panels.base import PanelContext
from app.ui.widgets.file_dialogs import FileKind
from nep.i18n import _, lazy

OPAQUE_IMAGE_KINDS = (
    FileKind(lazy("Image"), ".png"),
    FileKind(lazy("An image that stays sharp at any size"), ".svg"),
)
IMAGE_KINDS = (
    OPAQUE_IMAGE_KINDS[0],
    FileKind(lazy("Image with transparent background"), ".png"),
    OPAQUE_IMAGE_KINDS[1],
    FileKind(lazy("Vector image with transparent background"), ".svg"),
)


def suggested_path(project: OpenProject) -> Path:
    """Return the suggested path, without extension, of a file that is exported from a behaviour.

    The folder is that of the behaviour's file; for files in Studio's own folder it is the home folder.
    """
    path = project.path
    folder = path.parent if path is not None and path.parent != closed_tabs_folder() else Path.home()
    return folder / project.name


class ImageCommands:
    """Handlers that save or copy an image of the current behaviour's blocks.

    Args:
        context: Functions of the window.
        render: Renders all blocks. Receives the format "png" or "svg", True for a white background or False
            for a transparent one, and a function for the image data; b"" stands for no blocks.
    """

    def __init__(
        self, context: PanelContext, render: Callable[[PictureKind, bool, Callable[[bytes], None]], object]
    ) -> None:
        self._context, self._render = context, render

    def save_as(self) -> None:
        """Ask for a file and format, then save the image."""
        suggestion = suggested_path(self._context.session.document)

        def save_image(path: Path, kind: FileKind) -> None:
            self.save(path, "svg" if kind.suffix == ".svg" else "png", kind in OPAQUE_IMAGE_KINDS)

        self._context.files.save_as(_("Save blocks as image"), suggestion, IMAGE_KINDS, save_image)

    def save(self, path: Path, kind: PictureKind, white: bool) -> None:
        """Save an image of the blocks, adding the file extension if it is missing.

        Args:
            path: File to write.
            kind: Image format, "png" or "svg".
            white: True for a white background, False for a transparent one.
        """
        image_path = path if path.suffix.lower() == f".{kind}" else path.with_name(f"{path.name}.{kind}")

        def write(data: bytes) -> None:
            if not data:
                self._notify_no_blocks()
                return
            try:
                write_atomically(image_path, data)
            except OSError as error:
                self._context.show_toast(
                    _("Can't save the image: {why}").format(why=error.strerror or str(error))
                )
            else:
                self._context.show_toast(_("Saved {name}").format(name=image_path.name))

        self._render(kind, white, write)

    def copy(self) -> None:
        """Copy an image of the blocks to the clipboard."""

        def copy_image(data: bytes) -> None:
            image = QImage.fromData(data)
            if image.isNull():
                self._notify_no_blocks()
                return
            QGuiApplication.clipboard().setImage(image)
            self._context.show_toast(_("Copied the image"))

        self._render("png", True, copy_image)

    def _notify_no_blocks(self) -> None:
        self._context.show_toast(_("This page has no blocks"))
