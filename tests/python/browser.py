"""Pages in a real Chromium, driven by playwright; tests that use it are skipped if either is missing."""

import contextlib
import functools
import shutil
import sys
import time
from pathlib import Path

import pytest

FETCHED = Path(sys.prefix) / "share/gait/web"


def chromium():
    """Chromium and, if both are installed, playwright's `sync_playwright`; skip otherwise."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no chromium (Debian: chromium)")
    if not FETCHED.is_dir():
        pytest.skip("the parts of pages are absent: gait studio --fetch")
    return path, pytest.importorskip("playwright.sync_api", reason="no playwright").sync_playwright


@functools.cache
def _launched():
    """Playwright and a headless Chromium, for all pages of a file of tests."""
    path, start = chromium()
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    playwright = start().start()
    return playwright, playwright.chromium.launch(executable_path=path, args=options)


def end():
    """Close the Chromium, if one is open."""
    if _launched.cache_info().currsize:
        playwright, browser = _launched()
        browser.close()
        playwright.stop()
        _launched.cache_clear()


@contextlib.contextmanager
def opened(width=1280, height=720, dark=False, strict=True):
    """A page of its own; errors of its scripts and, if `strict`, of its console fail the test."""
    _, browser = _launched()
    page = browser.new_page(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light"
    )
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda text: faults.append(text.text) if text.type == "error" else None)
    page.set_default_timeout(20000)
    try:
        yield page
    finally:
        page.close()
    assert not (strict and faults), faults


def until(page, expression, seconds=60):
    """Wait until an expression is true in a page (whose security policy forbids playwright's own wait)."""
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < end, f"never true: {expression}"
        page.wait_for_timeout(30)


@contextlib.contextmanager
def serving(make_app):
    """Serve `make_app(port)` in a thread; returns the URL."""
    from gait.web import serve

    own = serve.listen(0)
    server, thread = serve.background(make_app(own.getsockname()[1]), own)
    try:
        yield serve.address(own)
    finally:
        server.should_exit = True
        thread.join()
