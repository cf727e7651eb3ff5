"""The promise of `bemt ui`: one page that answers, reads and judges, in a browser."""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import bemt

pytest.importorskip("streamlit", reason="the extra [ui] is not installed")
sync = pytest.importorskip("websockets.sync.client", reason="websockets, which steers the browser, is not installed")
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no chromium")
WAIT_S = 300.0


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def until(found: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        try:
            if (got := found()) not in (None, False, ""):
                return got
        except OSError:
            pass
        time.sleep(0.3)
    raise AssertionError(f"waited {WAIT_S:g} s for {what}")


class Tab:
    """One tab of the browser, by the Chrome DevTools protocol."""

    def __init__(self, socket: Any) -> None:
        self._ws, self._ids = socket, itertools.count(1)

    def call(self, method: str, **more: Any) -> dict[str, Any]:
        n = next(self._ids)
        self._ws.send(json.dumps({"id": n, "method": method, "params": more}))
        while True:
            told = json.loads(self._ws.recv(timeout=WAIT_S))
            if told.get("id") == n:
                return dict(told["result"])

    def js(self, code: str) -> Any:
        return self.call("Runtime.evaluate", expression=code)["result"].get("value")

    @property
    def text(self) -> str:
        return str(self.js("document.body ? document.body.innerText : ''"))

    def click(self, words: str) -> None:
        find = f"[...document.querySelectorAll('button')].find(b => b.innerText.trim() === {json.dumps(words)})"
        until(lambda: self.js(f"{find} !== undefined"), f"the button {words}")
        self.js(f"{find}.click()")

    def drop(self, file: Path) -> None:
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector="input[type=file]")["nodeId"]
        self.call("DOM.setFileInputFiles", files=[str(file)], nodeId=node)


@pytest.fixture(scope="module")
def page_and_browser(tmp_path_factory: pytest.TempPathFactory, project: Path) -> Iterator[tuple[str, str]]:
    """Addresses of the page and of a tab."""
    folder, port, door = tmp_path_factory.mktemp("ui"), free_port(), free_port()
    serve = [sys.executable, "-m", "bemt", "ui", "--no-browser", "--port", str(port)]
    browse = [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
              f"--user-data-dir={folder / 'profile'}", f"--remote-debugging-port={door}",
              "--remote-allow-origins=*", "about:blank"]  # fmt: skip
    paths = os.pathsep.join(filter(None, (str(project), os.environ.get("PYTHONPATH"))))
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    started = [subprocess.Popen(serve, cwd=folder, env={**os.environ, "PYTHONPATH": paths}, **quiet),
               subprocess.Popen(browse, **quiet)]  # fmt: skip
    try:
        until(lambda: urllib.request.urlopen(f"http://localhost:{port}/_stcore/health").read(), "the page")
        tabs = until(lambda: json.load(urllib.request.urlopen(f"http://127.0.0.1:{door}/json")), "the browser")
        yield f"http://localhost:{port}", next(t["webSocketDebuggerUrl"] for t in tabs if t["type"] == "page")
    finally:
        for process in started:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait(timeout=120)


@pytest.fixture
def tab(page_and_browser: tuple[str, str]) -> Iterator[Tab]:
    """The page as somebody who opens it sees it: a session of its own."""
    page, address = page_and_browser
    with sync.connect(address, max_size=None, ping_interval=None) as ws:  # a busy browser answers late
        one = Tab(ws)
        one.call("Page.navigate", url=page)
        yield one
        one.call("Page.navigate", url="about:blank")


def test_the_page_answers_reads_and_judges(tab: Tab, tmp_path: Path) -> None:
    """The label's thrust is the library's; a recording in other units is read; the verdict is the library's."""
    own = bemt.propeller("10x5")
    thrust = f"{own.solve(6000.0, 0.0).thrust_N[0]:.3g} ±"
    until(lambda: thrust in tab.text, f"the thrust {thrust}")
    until(lambda: tab.js("document.querySelectorAll('img').length >= 2"), "two curves")
    points = own.solve([3000, 4000, 5000, 6000, 7000], bands=False)
    gf = points.thrust_N / 9.80665e-3
    rows = [f"{n:g},{T:.2f},{Q:.6f}" for n, T, Q in zip(points.rpm, gf, points.torque_Nm, strict=True)]
    file = tmp_path / "bench.csv"
    file.write_text("\n".join(["rpm,thrust_gf,torque_Nm", *rows]))
    tab.drop(file)
    tab.click("Diagnose")
    head = " ".join(bemt.diagnose(file, own).text.partition("verdict: ")[0].split())
    until(lambda: head in tab.text, f"the sentence {head!r}")
    assert "DeltaGenerator" not in tab.text, "nothing of the page's own objects is shown"
    for width in (1400, 390):
        tab.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=2400, deviceScaleFactor=1, mobile=width < 500
        )
        until(
            lambda: tab.js("document.documentElement.scrollWidth <= window.innerWidth"), "a page without cut-off sides"
        )
        if folder := os.environ.get("BEMT_SCREENSHOTS"):  # to look at
            time.sleep(3.0)
            raw = tab.call("Page.captureScreenshot", format="png")["data"]
            Path(folder, f"ui_{width}.png").write_bytes(base64.b64decode(raw))


def test_a_workbook_of_several_sheets_asks_for_one(tab: Tab, tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    pytest.importorskip("openpyxl", reason="no writer of workbooks")
    with pd.ExcelWriter(tmp_path / "two.xlsx") as book:
        for name, thrust in (("before", 1.0), ("after it", 2.0)):
            pd.DataFrame({"rpm": [4000, 5000], "thrust_N": [thrust, 1.5625 * thrust]}).to_excel(book, sheet_name=name)
    until(lambda: "±" in tab.text, "the page")
    tab.drop(tmp_path / "two.xlsx")
    field = "[...document.querySelectorAll('[data-testid=stSelectbox]')].find(b => b.innerText.includes('tables'))"
    until(lambda: tab.js(f"{field} !== undefined"), "the choice of a sheet")
    assert "expected" not in tab.text, "asked, not refused"


def test_a_wrong_label_is_told_and_nothing_breaks(tab: Tab) -> None:
    until(lambda: "Label" in tab.text, "the page")
    tab.js("document.querySelector('input[type=text]').focus()")
    tab.js("document.querySelector('input[type=text]').select()")
    tab.call("Input.insertText", text="no propeller")
    for kind in ("keyDown", "keyUp"):
        tab.call("Input.dispatchKeyEvent", type=kind, key="Enter", code="Enter", windowsVirtualKeyCode=13, text="\r")
    until(lambda: "expected" in tab.text and "no propeller" in tab.text, "the fault")
