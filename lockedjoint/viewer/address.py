"""Where a page is served, and what is allowed to talk to it.

What comes in: a host and a port as text. What goes out: an `Address`, or an empty server of
viser at it, which answers no other site's page.
"""

from __future__ import annotations

import errno
import socket
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from lockedjoint.formulations.io.objects import library
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from viser import ViserServer

# Hosts that are reached from this machine only.
_LOCAL = ("127.0.0.1", "::1", "localhost")
# Largest number of a port.
_LAST_PORT = 65535
# Code with which a connection is closed that breaks the policy: RFC 6455, section 7.4.1.
_POLICY_VIOLATION = 1008
# Words for why a port cannot be listened on, by the code of the error.
_WHY = {errno.EADDRINUSE: "in use", errno.EACCES: "not allowed to this user"}


@dataclass(frozen=True)
class Address:
    """Where a page is served."""

    host: str = "127.0.0.1"  #: Name or address of this machine.
    port: int = 8080  #: 0 for any free one.

    @classmethod
    def parse(cls, text: str) -> Address:
        """Return the address that HOST:PORT states; InputError if it is none."""
        host, colon, port = text.rpartition(":")
        if not (colon and port.isdecimal() and port.isascii() and int(port) <= _LAST_PORT):
            allowed = "HOST:PORT, such as 127.0.0.1:8080; port 0 for any free one"
            raise InputError("address", text, allowed)
        return cls(host.strip("[]"), int(port))

    def free(self) -> Address:
        """Return the address with a port that can be listened on; InputError if none can."""
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        where = (self.host or " ", self.port)  # an empty name would be every address
        try:
            with socket.create_server(where, family=family) as tried:
                return Address(self.host, int(tried.getsockname()[1]))
        except (OSError, UnicodeError) as error:
            if why := _WHY.get(getattr(error, "errno", 0)):
                raise self.taken(why) from None
        allowed = "a name or an address of this machine, such as 127.0.0.1"
        raise InputError("host of the address", self.host, allowed)

    def taken(self, why: str) -> InputError:
        """Return the error of a port that cannot be listened on."""
        allowed = f"a free port of {self.host}, or 0 for any"
        return InputError("port of the address", f"{self.port}, {why}", allowed)

    @property
    def local(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host in _LOCAL

    def serves(self, host: str, origin: str | None) -> bool:
        """Whether a browser that names this `Host` and this `Origin` shows our own page.

        Any site that is open in a browser on this machine can connect to it, and can give
        itself a name that resolves to this machine.
        """
        ours = not self.local or urlsplit(f"//{host}").hostname in _LOCAL
        return ours and (origin is None or urlsplit(origin).netloc == host)

    @property
    def url(self) -> str:
        """The URL to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"


def serve(address: Address) -> ViserServer:
    """Start an empty page; InputError if viser is missing or the port is no longer free."""
    viser = library("viser")

    class Server(viser.ViserServer):  # type: ignore[misc, name-defined]
        """A server that opens no tunnel to the internet, whoever asks for one."""

        def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
            return None

    server = Server(address.host, address.port, label="lockedjoint", verbose=False)
    if server.get_port() != address.port:
        server.stop()
        raise address.taken(_WHY[errno.EADDRINUSE])
    _refuse_other_sites(server, address)
    return server


def _refuse_other_sites(server: ViserServer, address: Address) -> None:
    """Close a connection of another site's page before anything is sent or heard.

    viser has no hook of its own for the request, so its connections are looked up.
    """
    from websockets.exceptions import ConnectionClosed

    sockets = server._websock_server

    async def check(client: Any) -> None:
        """Close a new connection unless its browser shows our own page."""
        connection = sockets._live_connections[client.client_id]
        headers = connection.request.headers if connection.request else {}
        if address.serves(headers.get("Host", ""), headers.get("Origin")):
            return
        await connection.close(_POLICY_VIOLATION, "a page of another site")
        with suppress(ConnectionClosed):
            while True:  # what it sent already is not heard either
                await connection.recv()

    sockets.on_client_connect(check)
