"""Access to the server: its own pages and, from other machines, only with the token."""

from __future__ import annotations

import ipaddress
import secrets

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

COOKIE = "hovercontrol_token"

#: The page loads nothing from elsewhere, and no other page may frame it.
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def is_loopback(host: str) -> bool:
    """Return whether an address is reachable from this machine only.

    Examples
    --------
    >>> is_loopback("127.0.0.1"), is_loopback("localhost"), is_loopback("0.0.0.0")
    (True, True, False)
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def guard(token: str) -> Middleware:
    """Return the middleware that answers 403 to requests without access.

    Parameters
    ----------
    token : str
        Required in the address (``?token=``; stored in a cookie). ``""`` on loopback, where instead the host
        name in the request must be one of this machine's; other host names that resolve to it are rejected.

    Returns
    -------
    Middleware
        For :class:`aiohttp.web.Application`.
    """

    @web.middleware
    async def check(request: web.Request, handler: Handler) -> web.StreamResponse:
        given = request.query.get("token") or request.cookies.get(COOKIE, "")
        if token and not secrets.compare_digest(given.encode(errors="replace"), token.encode()):
            raise web.HTTPForbidden(text="403: this address needs ?token=..., as hovercontrol printed it\n")
        if not token and not is_loopback(_host_name(request.host)):
            raise web.HTTPForbidden(text="403: this server is for this machine only\n")
        origin = request.headers.get("Origin")
        changes = request.method != "GET" or request.headers.get("Upgrade", "").lower() == "websocket"
        if changes and origin != f"{request.scheme}://{request.host}":
            raise web.HTTPForbidden(text="403: pages of other sites cannot control this craft\n")
        response = await handler(request)
        if not response.prepared:
            response.headers.update(HEADERS)
            if token:
                response.set_cookie(COOKIE, token, httponly=True, samesite="Strict")
        return response

    return check


def _host_name(host: str) -> str:
    if host.startswith("["):  # [::1]:8321
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
