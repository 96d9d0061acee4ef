# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium controlled through its debugging pipe, without driver, port or further
package."""

import base64
import json
import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from typing import Any

WAIT_S = 60.0
"""General timeout: next to compilers a page is slow."""


class Page:
    """One page of the browser."""

    def __init__(self, read: int, write: int) -> None:
        self._read, self._write = read, write
        self._rest = b""
        self._number = 0
        self.problems: list[str] = []
        """Exceptions of scripts and violations of the page's policy."""
        target = self._ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        attached = self._ask("Target.attachToTarget", {"targetId": target, "flatten": True})
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Sends a command of the DevTools protocol to the page."""
        return self._ask(method, parameters, self._session)

    def _ask(
        self, method: str, parameters: dict[str, Any], session: str | None = None
    ) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                result: dict[str, Any] = answer["result"]
                return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            assert select([self._read], [], [], WAIT_S)[0], "the browser does not answer"
            data = os.read(self._read, 1 << 16)
            assert data, "the browser has gone"
            self._rest += data
        line, self._rest = self._rest.split(b"\0", 1)
        message: dict[str, Any] = json.loads(line)
        reported = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            details = reported["exceptionDetails"]
            self.problems.append(str(details.get("exception", details).get("description", details)))
        if message.get("method") == "Log.entryAdded" and reported["entry"]["level"] == "error":
            self.problems.append(reported["entry"]["text"])
        return message

    def size(self, width: int, height: int = 900) -> None:
        """Sets the size of the window."""
        self.ask(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    def scripts(self, run: bool) -> None:
        """Sets whether pages opened from now on may run scripts."""
        self.ask("Emulation.setScriptExecutionDisabled", value=not run)

    def prefers(self, scheme: str) -> None:
        """Sets the color scheme, `dark` or `light`."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.ask("Emulation.setEmulatedMedia", features=features)

    def open(self, address: str, ready: str = "document.readyState === 'complete'") -> None:
        """Opens a page and waits until `ready`."""
        self.ask("Page.navigate", url=address)
        # The address is the new one as soon as its first bytes are there, before its elements are.
        at_address = f"location.href.split('#')[0] === {json.dumps(address.split('#')[0])}"
        self.until(f"{at_address} && document.readyState !== 'loading'")
        self.until(ready)

    def value(self, expression: str) -> Any:
        """Returns the value of an expression on the page; waits for promises."""
        answer = self.ask(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, expression: str) -> None:
        """Waits until an expression is true."""
        end_s = time.monotonic() + WAIT_S
        while not self.value(f"Boolean({expression})"):
            assert time.monotonic() < end_s, f"never: {expression}; {self.problems}"
            time.sleep(0.05)

    def text(self, selector: str) -> str:
        """Returns the text of an element."""
        return str(self.value(f"document.querySelector({json.dumps(selector)}).textContent"))

    def key(self, name: str, text: str = "") -> None:
        """Presses and releases a key."""
        common = {"key": name, "code": name, "windowsVirtualKeyCode": KEYS.get(name, 0)}
        self.ask(
            "Input.dispatchKeyEvent", type="keyDown", **common, **({"text": text} if text else {})
        )
        self.ask("Input.dispatchKeyEvent", type="keyUp", **common)

    def mouse(self, kind: str, x: float, y: float, **further: Any) -> None:
        """Sends `mouseMoved`, `mousePressed`, `mouseReleased` or `mouseWheel`."""
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **further)

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Presses, moves and releases the mouse."""
        held = {"button": "left", "buttons": 1, "clickCount": 1}
        self.mouse("mouseMoved", *begin)
        self.mouse("mousePressed", *begin, **held)
        for share in (0.5, 1.0):
            at = [a + share * (b - a) for a, b in zip(begin, end, strict=True)]
            self.mouse("mouseMoved", at[0], at[1], **held)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def box(self, selector: str) -> dict[str, float]:
        """Scrolls to an element and returns its position in the window."""
        found = json.dumps(selector)
        self.value(f"document.querySelector({found}).scrollIntoView({{block: 'center'}})")
        box: dict[str, float] = self.value(
            f"(({{x, y, width, height}}) => ({{x, y, width, height}}))"
            f"(document.querySelector({found}).getBoundingClientRect())"
        )
        return box

    def picture(self, path: Path) -> None:
        """Writes the whole page as PNG."""
        shot = self.ask("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))

    def pdf(self) -> bytes:
        """Returns the print version."""
        return base64.b64decode(self.ask("Page.printToPDF", printBackground=False)["data"])


KEYS = {"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Home": 36, "End": 35,
        "Tab": 9, "Enter": 13, "Escape": 27}  # fmt: skip


@contextmanager
def browser(program: str, profile: Path) -> Iterator[Page]:
    """Starts a browser with an empty profile."""
    to_browser, from_us = os.pipe()
    to_us, from_browser = os.pipe()

    def give() -> None:
        # Its pipe ends must be 3 and 4; dup first, in case these numbers are in use.
        low, high = os.dup(to_browser), os.dup(from_browser)
        os.dup2(low, 3)
        os.dup2(high, 4)

    command = [
        program, "--headless=new", "--remote-debugging-pipe", "--no-first-run", "--disable-gpu",
        "--disable-dev-shm-usage", "--disable-background-networking", "--disable-extensions",
        "--hide-scrollbars", f"--user-data-dir={profile}",
        # Chromium's sandbox does not support root.
        *(["--no-sandbox"] if os.geteuid() == 0 else []), "about:blank",
    ]  # fmt: skip
    process = subprocess.Popen(
        command,
        preexec_fn=give,
        close_fds=False,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(to_browser)
    os.close(from_browser)
    try:
        yield Page(to_us, from_us)
    finally:
        os.close(from_us)
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        os.close(to_us)
