"""The page of ``bemt ui``: a server that ends with its parent, and the browser."""

from __future__ import annotations

import atexit
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import webbrowser
from importlib import resources

OPTIONS = {
    "server.address": "localhost", "server.headless": "true",  # else the first start waits for an e-mail address
    "browser.gatherUsageStats": "false", "server.fileWatcherType": "none", "server.maxUploadSize": 50,
    "client.toolbarMode": "minimal", "client.showErrorDetails": "none", "runner.magicEnabled": "false",
}  # fmt: skip
PARENT = "BEMT_UI_PARENT"
"""Process whose end is the page's, too."""
WAIT_S = 30.0


def serve(port: int, browser: bool) -> int:
    """Serve until interrupted; gives the server's exit code. Nothing is reachable from another machine."""
    page = resources.files("bemt.app") / "page.py"
    given = [word for key, value in {**OPTIONS, "server.port": port}.items() for word in (f"--{key}", str(value))]
    server = subprocess.Popen(
        [sys.executable, "-m", "streamlit", "run", str(page), *given], env={**os.environ, PARENT: str(os.getpid())}
    )
    atexit.register(server.terminate)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that atexit runs
    if browser:
        threading.Thread(target=_open, args=(port,), daemon=True).start()
    try:
        return server.wait()
    finally:
        server.terminate()


def taken(port: int) -> bool:
    """Whether somebody answers at a port of this machine."""
    with socket.socket() as probe:
        return probe.connect_ex(("localhost", port)) == 0


def _open(port: int) -> None:
    """Open the page when the server answers."""
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if taken(port):
            webbrowser.open(f"http://localhost:{port}")
            return
        time.sleep(0.2)


def end_with_parent() -> None:
    """Within the page: end when the process that started it is gone, however it went."""
    parent = int(os.environ.pop(PARENT, "0"))

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(0)

    if parent and os.getppid() == parent:
        threading.Thread(target=watch, daemon=True).start()
