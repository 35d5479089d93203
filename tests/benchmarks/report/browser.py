"""A headless Chromium, where there is one."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--window-size=1366,900",
)  # fmt: skip


def missing() -> str:
    """What of a browser and its driver is not here; empty where both are."""
    browser = next((name for name in _BROWSERS if shutil.which(name)), None)
    found = {"chromium": browser, "chromedriver": shutil.which("chromedriver")}
    names = [name for name, path in found.items() if not path]
    return f"no {' and no '.join(names)} (apt-get install chromium chromium-driver)" if names else ""


@contextmanager
def browser() -> Iterator[webdriver.Chrome]:
    """Start a browser without any history; its console is in `get_log("browser")`."""
    with tempfile.TemporaryDirectory() as profile:
        options = Options()
        options.binary_location = next(filter(None, map(shutil.which, _BROWSERS)))
        for flag in (*_FLAGS, f"--user-data-dir={Path(profile)}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
        try:
            yield driver
        finally:
            driver.quit()
