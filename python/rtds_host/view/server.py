"""The page's server: on this machine's loopback only, in this process, with nothing but what the feed holds."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from urllib.parse import parse_qs, urlsplit

from rtds_host.compat import Self
from rtds_host.errors import InputError
from rtds_host.view.live import Feed

HOST = "127.0.0.1"
# Contract of the page with itself: it loads its script and its data from here, and nothing from elsewhere.
POLICY = (
    "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; img-src data:; frame-ancestors 'none'"
)
FILES = {
    "/": ("view.html", "text/html; charset=utf-8"),
    "/view.css": ("view.css", "text/css; charset=utf-8"),
    "/view.js": ("view.js", "text/javascript; charset=utf-8"),
}
# More runs than a page can show, and longer than any list that it sends.
LONGEST_QUERY = 2000


def _asset(name: str) -> bytes:
    return resources.files("rtds_host.view").joinpath(name).read_bytes()


class _Answer(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        """The page, its script and style, or the feed's rows from those on that the page names."""
        # A page of somebody else may send a browser here under its own name: such a name is no address of ours.
        host = self.headers.get("Host", "").rsplit(":", 1)[0]
        if host not in (HOST, "localhost"):
            return self._send(403, b"asked for under a name that is not this machine's\n", "text/plain; charset=utf-8")
        parts = urlsplit(self.path)
        if parts.path in FILES:
            name, kind = FILES[parts.path]
            return self._send(200, _asset(name), kind)
        if parts.path == "/runs.json" and len(parts.query) <= LONGEST_QUERY:
            given = parse_qs(parts.query).get("since", [""])[0].split(",")
            since = [int(word) if word.isascii() and word.isdigit() else 0 for word in given if word]
            body = json.dumps(self.server.feed.json(since), separators=(",", ":"), allow_nan=False)
            return self._send(200, body.encode(), "application/json")
        return self._send(404, b"there is no such page\n", "text/plain; charset=utf-8")

    def _send(self, status: int, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: the terminal is the run's."""


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, port: int, feed: Feed):
        self.feed = feed
        super().__init__((HOST, port), _Answer)


class Viewer:
    """Serves a feed while it is open, in a thread of this process.

    port : 0 takes any that is free. `address` is what a browser opens.

    Raises
    ------
    InputError : the port is taken or not allowed.
    """

    def __init__(self, feed: Feed, port: int = 0):
        try:
            self._server = _Server(port, feed)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise InputError(f"--port {port}: cannot be listened at ({why})") from error
        self.address = f"http://{HOST}:{self._server.server_address[1]}/"
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
