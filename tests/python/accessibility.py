"""Check the accessibility of a page that is open in Chromium, at every width, light and dark, by axe-core.

``python accessibility.py`` fetches axe-core by npm (make setup does); without it the check is left out.
"""

import itertools
import shutil
import sys
import warnings

import browser

from gait.io.published import Published, Store

SIZES, SCHEMES = ((390, 844), (1280, 720), (1920, 1080)), ("light", "dark")
AXE = Published(
    "axe.min.js",
    "axe-core@4.10.3",
    "package/axe.min.js",
    "880970c081707360e64f34cea25ff91892f5bc95675b0776925b9709dd8a68bb",
)
STORE = Store(
    "axe",
    "GAIT_AXE",
    "the parts of the accessibility check",
    "run .venv/bin/python tests/python/accessibility.py once, with npm and a network",
    (AXE,),
    "axe.min.js: axe-core 4.10.3, copyright Deque Systems, MPL-2.0 (http://mozilla.org/MPL/2.0/).\n",
)
_SERIOUS = """async () => (await axe.run(document, {resultTypes: ['violations']})).violations
    .filter(({impact}) => ['serious', 'critical'].includes(impact))
    .map(({id, help, nodes}) => [id, help, ...nodes.slice(0, 3).map((node) => node.html)].join('  '))"""

_BEYOND = """[...document.querySelectorAll('body *')]
    .filter((each) => each.getBoundingClientRect().right > innerWidth && !each.closest('.movable'))
    .map((each) => each.outerHTML.slice(0, 120)).slice(0, 5)"""


def check(page):
    """Assert that a page does not scroll sideways and has no serious finding, light and dark."""
    for (width, height), scheme in itertools.product(SIZES, SCHEMES):
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(color_scheme=scheme)
        across = page.evaluate("document.documentElement.scrollWidth")
        assert across <= width, (width, scheme, page.evaluate(_BEYOND))
        check_here(page)


def check_file(path):
    """Check a page in a file, if there is a Chromium."""
    if browser.FETCHED.is_dir() and (shutil.which("chromium") or shutil.which("chromium-browser")):
        with browser.opened() as page:
            page.goto(path.absolute().as_uri())
            check(page)


def check_here(page):
    """Assert that axe-core has no serious finding on a page as it is shown."""
    if STORE.find(AXE) is None:
        warnings.warn(f"accessibility is not checked: {STORE.remedy}", stacklevel=2)
        return
    if not page.evaluate("'axe' in window"):
        page.evaluate(STORE.load(AXE).decode())
    found = page.evaluate(_SERIOUS)
    assert not found, (page.viewport_size, found)


if __name__ == "__main__":
    STORE.fetch(lambda line: print(line, file=sys.stderr))
