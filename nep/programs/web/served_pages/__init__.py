"""Pages that `nep web` serves itself by HTTP: a test page, and a starter page for pages of your own."""

from nep.programs.web.served_pages.answers import PageRequest, PageResponse, answer, starter_page

__all__ = ["PageRequest", "PageResponse", "answer", "starter_page"]
