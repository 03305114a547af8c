"""Pages served by `nep web` over HTTP: a test page, and a template for your own pages."""

from nep.programs.web.served_pages.responses import PageRequest, PageResponse, respond, starter_page

__all__ = ["PageRequest", "PageResponse", "respond", "starter_page"]
