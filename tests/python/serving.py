"""How a shader server is reached: what its command line says, a socket to listen on or a display to dial, and who may come in."""

import hashlib
import hmac
import os
import pathlib
import socket
import sys
import threading
import time

from session import Session, Store

MAGIC = b"EP-AUTH1"
LABELS = {"display": b"edge-point display 1", "server": b"edge-point shader server 1"}
# Time for all of the proof, and between attempts to reach a display, seconds.
PROOF, PAUSE = 5, 0.5
LEAST_SECRET, MOST_SECRET = 16, 4096
# Displays served at once; more are turned away.
MOST_DISPLAYS = 64

OPTIONS = """    --listen HOST:PORT    address to listen on, port 0 for any free one (default 127.0.0.1:0)
    --dial HOST:PORT      connects to a display that accepts servers, again and again, instead of listening
    --secret-file FILE    secret that both sides must know; for other addresses than loopback there must be one
    --parent-stdin        ends when standard input does"""


class Usage(Exception):
    """Something on the command line is to be mended."""


class Stranger(Exception):
    """The peer does not know the secret."""


def parse(arguments, more):
    """Options of every server, and of `more`: names of options with what makes a value of their text."""
    options = {"listen": "127.0.0.1:0", "dial": None, "secret-file": None, "threads": None, "parent-stdin": False}
    waiting = list(arguments)
    while waiting:
        name = waiting.pop(0)
        key = name.removeprefix("--")
        if key == "parent-stdin":
            options[key] = True
        elif name.startswith("--") and (key in options or key in more) and waiting:
            try:
                options[key] = more.get(key, str)(waiting.pop(0))
            except ValueError as error:
                raise Usage(f"{name}: {error}") from None
        else:
            raise Usage(f"{name} is no option, or lacks its value")
    return options


def read_secret(path):
    if path is None:
        return None
    try:
        secret = pathlib.Path(path).read_bytes().removesuffix(b"\n").removesuffix(b"\r")
    except OSError as error:
        raise Usage(f"cannot read the secret file: {error}") from None
    if not LEAST_SECRET <= len(secret) <= MOST_SECRET:
        raise Usage(f"{path}: a secret has {LEAST_SECRET} to {MOST_SECRET} bytes")
    return secret


def split(address):
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise Usage(f"{address} is not HOST:PORT")
    return host.strip("[]"), int(port)


def prove(connection, secret, accepted):
    """Both sides show that they know the secret, before any message (section 9)."""
    deadline = time.monotonic() + PROOF

    def exactly(count):
        data = b""
        while len(data) < count:
            connection.settimeout(max(deadline - time.monotonic(), 1e-3))
            more = connection.recv(count - len(data))
            if not more:
                raise Stranger("it left")
            data += more
        return data

    def tag(role, *nonces):
        return hmac.new(secret, LABELS[role] + b"".join(nonces), hashlib.sha256).digest()

    own = os.urandom(32)
    if accepted:
        connection.sendall(MAGIC + own)
        other, proof = exactly(32), exactly(32)
        nonces = own, other
    else:
        if exactly(8) != MAGIC:
            raise Stranger("it does not ask for a secret")
        other = exactly(32)
        nonces = other, own
        connection.sendall(own + tag("server", *nonces))
        proof = exactly(32)
    if not hmac.compare_digest(proof, tag("display", *nonces)):
        raise Stranger("its proof is wrong")
    if accepted:
        connection.sendall(tag("server", *nonces))
    connection.settimeout(None)


def attend(connection, secret, accepted, store):
    """Serves a display until it leaves."""
    try:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if secret is not None:
            prove(connection, secret, accepted)
    except (OSError, Stranger):
        connection.close()
        return
    Session(connection, store).run()


def listen(address, secret, store):
    host, port = split(address)
    family, _, _, _, found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    if not (found[0].startswith("127.") or found[0] == "::1") and secret is None:
        raise Usage(f"{address} is not a loopback address: that needs --secret-file")
    listener = socket.create_server(found[:2], family=family, backlog=128)
    shown = f"[{found[0]}]" if family == socket.AF_INET6 else found[0]
    print(f"listening on {shown}:{listener.getsockname()[1]}", flush=True)
    return lambda: accept(listener, secret, store)


def accept(listener, secret, store):
    places = threading.BoundedSemaphore(MOST_DISPLAYS)

    def attended(connection):
        try:
            attend(connection, secret, True, store)
        finally:
            places.release()

    while True:
        connection, _ = listener.accept()
        if places.acquire(blocking=False):
            threading.Thread(target=attended, args=(connection,), daemon=True).start()
        else:
            connection.close()


def dial(address, secret, store):
    host, port = split(address)
    if host not in ("127.0.0.1", "localhost", "::1") and secret is None:
        raise Usage(f"{address} is not a loopback address: that needs --secret-file")

    def again_and_again():
        while True:
            try:
                connection = socket.create_connection((host, port), PROOF)
                connection.settimeout(None)
                attend(connection, secret, False, store)
            except OSError:
                pass
            time.sleep(PAUSE)

    return again_and_again


def main(documentation, options, shader, digest):
    """Serves until told to stop. Returns the exit code."""
    try:
        secret = read_secret(options["secret-file"])
        store = Store(shader, digest)
        way, address = (dial, options["dial"]) if options["dial"] else (listen, options["listen"])
        serve = way(address, secret, store)
    except (Usage, OSError) as error:
        print(f"{documentation.split(':')[0]}: {error}", file=sys.stderr)
        return 2
    if not options["parent-stdin"]:
        serve()
    threading.Thread(target=serve, daemon=True).start()
    # The parent has ended when its end of the pipe is closed.
    while os.read(sys.stdin.fileno(), 4096):
        pass
    return 0
