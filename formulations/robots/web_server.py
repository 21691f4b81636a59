"""Where a web page is served, and the viser server that serves it."""

from __future__ import annotations

import errno
import socket
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING

from nlp.errors import InputError, MissingLibraryError

if TYPE_CHECKING:
    from viser import ViserServer


@dataclass(frozen=True)
class Address:
    """Where a page is served, and from whom.

    Attributes
    ----------
    host, port
        Of this machine; port 0 for any free one.
    """

    host: str = "127.0.0.1"
    port: int = 8080

    def free(self) -> Address:
        """Return the address with a port that can be listened on.

        Raises
        ------
        InputError
            If there is no such host here, or the port is in use or not allowed.
        """
        try:
            family, kind, _, _, where = socket.getaddrinfo(
                self.host, self.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
        except (OSError, UnicodeError):
            allowed = "a name or an address of this machine, such as 127.0.0.1"
            raise InputError("--host", self.host, allowed) from None
        with socket.socket(family, kind) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                tried.bind(where)
                tried.listen(1)
            except OSError as error:
                if error.errno in (errno.EADDRINUSE, errno.EACCES):
                    used = error.errno == errno.EADDRINUSE
                    why = "in use" if used else "not allowed to this user"
                    allowed = f"a free port of {self.host}, or 0 for any"
                    raise InputError("--port", f"{self.port}, {why}", allowed) from None
                allowed = "a name or an address of this machine, such as 127.0.0.1"
                raise InputError("--host", self.host, allowed) from None
            return Address(self.host, int(tried.getsockname()[1]))

    @property
    def local(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host in ("127.0.0.1", "::1", "localhost")

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"


def serve(address: Address) -> ViserServer:
    """Start an empty page.

    Raises
    ------
    MissingLibraryError
        If viser is not installed.
    InputError
        If the port is no longer free.
    """
    try:
        import viser
    except ImportError:
        raise MissingLibraryError("viser") from None

    class Server(viser.ViserServer):
        """A server that opens no tunnel to the internet, whoever asks for one."""

        def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
            return None

    with redirect_stdout(StringIO()):  # its own greeting
        server = Server(address.host, address.port, label="lockedjoint", verbose=False)
    if server.get_port() != address.port:
        server.stop()
        allowed = f"a free port of {address.host}, or 0 for any"
        raise InputError("--port", f"{address.port}, in use", allowed)
    return server
