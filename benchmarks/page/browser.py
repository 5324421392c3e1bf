"""Somebody before the live page: Debian's Chromium without a window, with a mouse and a keyboard."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
LOOK = 0.05  # between two looks at the page [s]


@contextmanager
def chromium(profile: Path, width: int = 1400, height: int = 1000, nice: int = 0) -> Iterator[Any]:
    """A browser of its own profile, in CSS pixels, so much nicer than we are; it ends with the block."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for argument in (
        "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        f"--window-size={width},{height}", f"--user-data-dir={profile}",
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(
        options, webdriver.ChromeService(str(DRIVER), popen_kw={"preexec_fn": lambda: os.nice(nice)})
    )
    try:
        yield driver
    finally:
        driver.quit()


class Operator:
    """What an operator does and sees.

    Parameters
    ----------
    driver : of the browser. timeout : for anything that is waited for [s].
    """

    def __init__(self, driver: Any, timeout: float = 120.0) -> None:
        self.driver, self.timeout, self.refusal = driver, timeout, ""
        self.clicks = 0

    def see(self, script: str) -> Any:
        """The value of a JavaScript expression."""
        return self.driver.execute_script(f"return {script}")

    def wait_for(self, what: str, seen: Callable[[], Any], timeout: float = 0.0) -> Any:
        """What `seen` answers once that is true; AssertionError, with what the page says, where it never is."""
        end = time.monotonic() + (timeout or self.timeout)
        while not (found := seen()):
            state = self.see("document.getElementById('state').innerText")
            assert time.monotonic() < end, f"{what} never came; state {state!r}, {self.answers()[-3:]} {self.refusal}"
            time.sleep(LOOK)
        return found

    def state(self, name: str) -> None:
        """Wait for a state of the table."""
        self.wait_for(f"state {name}", lambda: self.see("document.body.dataset.state") == name)

    def find(self, css: str) -> Any:
        """The first element, as soon as there is one."""
        return self.wait_for(css, lambda: self.driver.find_elements("css selector", css))[0]

    def click(self, css: str) -> None:
        """As soon as it can be clicked; what the page replaces meanwhile is looked for again."""
        from selenium.common.exceptions import WebDriverException

        def clicked() -> bool:
            try:
                element = self.driver.find_element("css selector", css)
                if element.is_enabled():
                    self.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
                    element.click()
                    return True
            except WebDriverException as error:
                self.refusal = str(error.msg).partition("\n")[0]
            return False

        self.wait_for(css, clicked)
        self.clicks += 1

    def tab(self, name: str) -> None:
        """Watch, run or learn."""
        self.click(f"nav [data-tab={name}]")

    def type(self, css: str, text: str) -> None:
        """Instead of what the field holds; what the page replaces meanwhile is looked for again."""
        from selenium.common.exceptions import WebDriverException
        from selenium.webdriver import Keys

        def typed() -> bool:
            try:
                self.driver.find_element("css selector", css).send_keys(Keys.CONTROL, "a", Keys.NULL, text)
                return True
            except WebDriverException:
                return False

        self.wait_for(f"{text!r} in {css}", typed)
        self.clicks += 1

    def choose(self, css: str, value: str) -> None:
        """One of a list, by what it shows."""
        from selenium.common.exceptions import WebDriverException
        from selenium.webdriver.support.ui import Select

        def chosen() -> bool:
            try:
                Select(self.driver.find_element("css selector", css)).select_by_visible_text(value)
                return True
            except WebDriverException:
                return False

        self.wait_for(f"{value} in {css}", chosen)
        self.clicks += 1

    def answers(self) -> list[str]:
        """What the laboratory has answered to clicks."""
        return [answer["text"] for answer in self.see("shake.answers")]

    def said(self, text: str) -> None:
        """Wait for an answer with `text`."""
        self.wait_for(f"{text!r}", lambda: any(text in answer for answer in self.answers()))

    def peak(self, curve: str) -> float:
        """Largest magnitude of a curve as shown."""
        return float(self.see(f"Math.max(0, ...shake.curves.column('{curve}').filter(v => v != null).map(Math.abs))"))

    def seconds(self) -> float:
        """The table's time at the right edge [s]."""
        return float(self.see("shake.curves.shownNow().newest"))

    def pass_time(self, seconds: float) -> None:
        """Of the table [s]."""
        until = self.seconds() + seconds
        self.wait_for(f"{seconds} s of the table's time", lambda: self.seconds() > until)

    def errors(self) -> list[str]:
        """What the browser's console complains of."""
        return [entry["message"] for entry in self.driver.get_log("browser") if "favicon" not in entry["message"]]
