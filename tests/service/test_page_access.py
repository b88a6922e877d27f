"""The key of the page, over the lives of the display."""

from __future__ import annotations

from fti.service.supervisor.page_access import PageAccess


def test_a_display_that_has_gone_takes_its_key_with_it() -> None:
    """Another user's program may have got its port: what the owner's browser sends there must be worth nothing."""
    page = PageAccess("127.0.0.1", shows_key=True)
    page.on_port(8080)
    key, url = page.key, page.owner_url
    assert url == f"http://127.0.0.1:8080/#key={key}"
    page.forget()
    assert page.owner_url is None and page.url is None
    page.on_port(8080)
    assert page.key != key and page.owner_url != url
