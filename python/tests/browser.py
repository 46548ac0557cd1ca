"""A headless Chromium, driven through two pipes by its DevTools protocol."""

import base64
import contextlib
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

#: Names of the program; the shells of Debian are small packages without a window.
_NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
_TIMEOUT = 120  # s; for a page on a busy machine
#: Answers of Chromium to a command that was under way when the tab went to another page.
_NAVIGATION = ("Inspected target navigated or closed", "Execution context was destroyed.", "Cannot find default execution context",
               "Cannot find context with specified id")


def find():
    """The path of Chromium, None if it is not installed."""
    return next(filter(None, map(shutil.which, _NAMES)), None)


class Navigation(RuntimeError):
    """The tab went to another page while it had a command."""


class Browser:
    """One tab. `messages` holds warnings and errors of the console, and exceptions, since the last visit()."""

    def __init__(self, program, width=1280, height=860):
        self._profile = tempfile.TemporaryDirectory(prefix="pliant-browser-", ignore_cleanup_errors=True)
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()
        command = [program, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", "--mute-audio",
                   "--no-first-run", "--disable-background-networking", f"--user-data-dir={self._profile.name}", f"--window-size={width},{height}",
                   "--remote-debugging-pipe", "about:blank"]

        def pipes():  # the protocol has the descriptors 3 and 4
            os.dup2(to_read, 63)
            os.dup2(to_write, 64)
            os.dup2(63, 3)
            os.dup2(64, 4)

        self._process = subprocess.Popen(command, preexec_fn=pipes, close_fds=False, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self._buffer, self._number, self._session, self.messages = b"", 0, None, []
        target = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError, RuntimeError):
            self._session = None
            self.call("Browser.close")
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._write)
        os.close(self._read)
        self._profile.cleanup()

    def _next(self):
        while b"\0" not in self._buffer:
            part = os.read(self._read, 1 << 20)
            if not part:
                raise RuntimeError("Chromium has ended")
            self._buffer += part
        text, self._buffer = self._buffer.split(b"\0", 1)
        message = json.loads(text)
        parameters = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.messages.append(details.get("exception", {}).get("description") or details["text"])
        elif message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning", "assert"):
            self.messages.append(" ".join(str(one.get("value", one.get("description"))) for one in parameters["args"]))
        elif message.get("method") == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
            self.messages.append(parameters["entry"]["text"])
        return message

    def call(self, method, **parameters):
        """The result of a command of the protocol. Raises RuntimeError."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._write, data):]
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                if "error" in answer:
                    fault = answer["error"]["message"]
                    raise (Navigation if fault in _NAVIGATION else RuntimeError)(f"{method}: {fault}")
                return answer["result"]

    def evaluate(self, expression):
        """The value of a JavaScript expression; waits for promises."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description", "exception"))
        return answer["result"].get("value")

    def wait(self, expression):
        """Waits until an expression is true, also of a page to which the tab is on its way."""
        end = time.monotonic() + _TIMEOUT
        while True:
            with contextlib.suppress(Navigation):
                if self.evaluate(expression):
                    return
            if time.monotonic() > end:
                raise RuntimeError(f"{expression}: not true after {_TIMEOUT} s; {self.messages}")
            time.sleep(0.05)

    def visit(self, path):
        """Opens a report and waits until it is built."""
        self.messages = []
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=Path(path).resolve().as_uri())
        self.wait("document.documentElement?.dataset.ready === 'yes'")

    def key(self, key, text=None):
        """Presses a key."""
        names = {"key": key, "code": {" ": "Space"}.get(key, key)} | ({"text": text or key} if len(key) == 1 else {})
        self.call("Input.dispatchKeyEvent", type="keyDown", **names)
        self.call("Input.dispatchKeyEvent", type="keyUp", **names)

    def dark(self, on=True):
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark" if on else "light"}])

    def size(self, width, height, ratio=1):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=ratio, mobile=False)

    def screenshot(self, path, full=False):
        """Writes a PNG file of the window, or of the full page."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=full)["data"]
        Path(path).write_bytes(base64.b64decode(data))
