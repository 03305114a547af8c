"""Project: pages of blocks, with the robots that they use. All values are immutable."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from app.blocks.model.workspace_json import WorkspaceJson

PageKind = Literal["always", "reaction", "goal", "module"]
PAGE_KINDS: tuple[PageKind, ...] = get_args(PageKind)
ALWAYS_ID = "always"
ALWAYS_NAME = "Always"

_revisions = itertools.count(1)


@dataclass(frozen=True)
class Page:
    """Page of a project.

    Attributes:
        id: Id, unique in the project. The page that runs from the start has the id "always".
        name: Name given by the user.
        kind: Kind of the page.
        workspace: Blocks.
        revision: Number that no other page value of this process has, as a key of caches.
    """

    id: str
    name: str
    kind: PageKind
    workspace: WorkspaceJson
    revision: int = field(default_factory=lambda: next(_revisions), init=False, compare=False, repr=False)

    @property
    def block_prefix(self) -> str:
        """Prefix of the ids of this page's blocks in a program; "" for the page "always"."""
        return "" if self.kind == "always" else f"{self.id}/"

    def with_workspace(self, workspace: WorkspaceJson) -> Page:
        """Return the page with other blocks and a new revision."""
        return replace(self, workspace=workspace)


def always_page(workspace: WorkspaceJson) -> Page:
    """Return the page "always" with these blocks."""
    return Page(ALWAYS_ID, ALWAYS_NAME, "always", workspace)


@dataclass(frozen=True)
class Project:
    """Content of a behaviour file.

    Attributes:
        name: Name of the project.
        pages: Pages; the first one, and no other, is of the kind "always".
        robots: Descriptions of the robots in use, by name.
        unknown_fields: Fields of the file that this version doesn't know.

    Raises:
        ValueError: The page "always" is missing, or two pages have the same id.
    """

    name: str
    pages: tuple[Page, ...]
    robots: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    unknown_fields: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if [page.id for page in self.pages if page.kind == "always"] != [ALWAYS_ID]:
            raise ValueError("a project has exactly one page of the kind 'always'")
        if self.pages[0].kind != "always" or len({page.id for page in self.pages}) < len(self.pages):
            raise ValueError("the first page is 'always', and ids of pages are unique")

    @classmethod
    def of_blocks(
        cls,
        name: str,
        blocks: Mapping[str, object],
        robots: Mapping[str, Mapping[str, object]] | None = None,
        unknown_fields: Mapping[str, object] | None = None,
    ) -> Project:
        """Return a project with only the page "always".

        Args:
            name: Name of the project.
            blocks: Blocks in Blockly's JSON format, which must not be changed afterwards.
            robots: Descriptions of the robots in use, by name.
            unknown_fields: Fields of the file that this version doesn't know.
        """
        page = always_page(WorkspaceJson.from_blocks(blocks))
        return cls(name, (page,), robots or {}, unknown_fields=unknown_fields or {})

    @property
    def always(self) -> Page:
        """Page whose scripts run from the start."""
        return self.pages[0]

    @property
    def modules(self) -> tuple[Page, ...]:
        """Pages whose functions all other pages can call."""
        return tuple(page for page in self.pages if page.kind == "module")

    @property
    def is_single_page(self) -> bool:
        """True if the project has only the page "always", as all files of earlier versions."""
        return len(self.pages) == 1

    def page(self, id: str) -> Page:
        """Return a page. Raises KeyError if there is none with this id."""
        for page in self.pages:
            if page.id == id:
                return page
        raise KeyError(id)

    def with_page(self, page: Page) -> Project:
        """Return the project with a page added, or replaced if there is one with the same id."""
        if all(each.id != page.id for each in self.pages):
            return replace(self, pages=(*self.pages, page))
        return replace(self, pages=tuple(page if each.id == page.id else each for each in self.pages))
