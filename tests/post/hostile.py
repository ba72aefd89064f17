"""Requests of every kind to a server on this computer."""

import contextlib
import random
import socket
import struct

from whole_runs import PATIENCE

#: What requests are made of, good and bad.
METHODS = b"GET GET GET get POST HEAD TRACE PRI \x16\x03\x01 G\0ET *".split()
PATHS = rb"""/ /film /film?known=%ff% //film /../gas.nml * film ? http://[::1/film http://[/ //[::1
    http://a:b:c/ http://127.0.0.1:PORT/film /LONG /start /form?gas /form?../gas /1/2/ /1/2/output
    /state?LONG /picture?%00""".split()
VERSIONS = rb"HTTP/1.0 HTTP/1.1 HTTP/0.9 HTTP/2.0 HTTP/1. HTTP/x.1 HTTP/-1.1 HTTP/9LONG.1 x".split()
HEADERS = rb"""Host: 127.0.0.1:PORT|Host: [::1|Host:|host|: a| folded|Expect: 100-continue|a: LONG|
Origin: http://127.0.0.1:PORT|Content-Length: 2|Content-Length: -1|Content-Length: 9LONG"""
PIECES = ([*METHODS, b"\xff"], [*PATHS, b"/\xff\0", b""], [*VERSIONS, b"\xff/1.1", b""])


def status_of(port, request, reset=False):
    """The status that the server answers to these bytes; 0 without an answer."""
    answer = b""
    with (
        socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection,
        contextlib.suppress(ConnectionError),  # the server has not read all that was sent
    ):
        connection.sendall(request)
        if reset:  # the connection breaks off
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return 0
        with contextlib.suppress(OSError):  # it has hung up already
            connection.shutdown(socket.SHUT_WR)
        while part := connection.recv(65536):
            answer += part
    assert answer == b"" or answer.startswith(b"HTTP/1.0 "), answer
    return int(answer[9:12] or 0)


def besiege(port, requests):
    """Send so many requests made of PIECES: each is answered, by 200 only under the own name."""
    host = f"Host: 127.0.0.1:{port}\r\n\r\n".encode()
    rng = random.Random(31)
    for _ in range(requests):
        line = b" ".join(rng.choice(words) for words in PIECES)
        lines = [line, *rng.choices(HEADERS.split(b"|"), k=rng.choice((0, 1, 2, 150)))]
        request = rng.choice((b"\r\n", b"\n", b"\r")).join(lines) + b"\r\n\r\n"
        if rng.random() < 0.3:  # damaged
            place = rng.randrange(len(request))
            request = request[:place] + rng.randbytes(rng.randrange(9)) + request[place + 1 :]
        request = request.replace(b"PORT", str(port).encode())
        request = request.replace(b"LONG", rng.choice((b"", b"9" * 70000)))
        status = status_of(port, request, reset=rng.random() < 0.1)
        assert status in (0, 200) or 400 <= status < 500, request
        assert status != 200 or (request.startswith(b"GET /") and host[:-4] in request), request
