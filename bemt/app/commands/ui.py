"""``bemt ui``: one page in the browser on this machine, over the public API."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_INTERNAL, EXIT_OK

NAME = "ui"
HELP = "open a page in the browser: label, motor, curves with bands, a recording, the diagnosis, exports"
GROUP = "Propellers and fans"
EXAMPLE = "ui"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--port", type=int, default=8501, metavar="N", help="port on this machine (default 8501)")
    parser.add_argument("--no-browser", action="store_true", help="only serve the page")


def run(args: argparse.Namespace) -> int:
    """Serve the page until it is interrupted; nothing is reachable from another machine."""
    import subprocess
    import sys
    from importlib import resources

    from bemt.base.errors import Fault, InputError, needs

    if not 1024 <= args.port <= 65535:
        raise InputError(Fault("--port", "", f"{args.port}", "1024 to 65535"))
    needs("streamlit", "ui")
    page = resources.files("bemt.app.library") / "page.py"
    options = {
        "server.address": "localhost", "server.port": args.port, "server.headless": str(args.no_browser).lower(),
        "browser.gatherUsageStats": "false", "server.fileWatcherType": "none", "server.maxUploadSize": 50,
        "client.toolbarMode": "minimal", "client.showErrorDetails": "none",
        "runner.magicEnabled": "false",
    }  # fmt: skip
    words = [word for key, value in options.items() for word in (f"--{key}", str(value))]
    done = subprocess.run([sys.executable, "-m", "streamlit", "run", str(page), *words], check=False)
    return EXIT_OK if done.returncode == 0 else EXIT_INTERNAL
