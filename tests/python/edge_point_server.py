#!/usr/bin/env python3
"""A shader server written from PROTOCOL.md alone: direct light and diffuse reflection, slowly.

    edge_point_server.py [--listen HOST:PORT] [--parent-stdin]

The first line on standard output is `listening on HOST:PORT`. A display starts it with `--shader` and this file's name.
Needs nothing but the standard library. Maps, gloss and indirect light are left out: what is told as fields of a scene and
not used is read all the same.
"""

import collections
import math
import os
import socket
import sys
import threading

sys.dont_write_bytecode = True

import tracer  # noqa: E402 (modules must not be compiled into the checkout)
import wire  # noqa: E402
from blake3_hash import blake3  # noqa: E402
from wire import Surprise  # noqa: E402

CREDITS, MAX_BATCH, VIEWS = 4096, 1024, 256
MAX_SCENE = 64 << 20
# Samples of one message: few, so that they come soon.
PORTION = 16


class Broken(Exception):
    """The display broke a rule; the code is one of section 6."""

    def __init__(self, code, text):
        super().__init__(text)
        self.code = wire.FAULTS.index(code)


class Session:
    """One display. Its messages are read by one thread and its samples traced by another."""

    def __init__(self, connection):
        self.connection = connection
        self.changed = threading.Condition()
        self.phase, self.seed, self.views = "greeting", 0, collections.OrderedDict()
        self.digest, self.wanted, self.data = b"", 0, bytearray()
        self.scene, self.epoch, self.told = None, 0, set()
        self.held, self.waiting = {}, collections.deque()
        self.cancelled, self.traced, self.ended = 0, 0, False

    def send(self, payload):
        with self.changed:
            self.connection.sendall(wire.frame(payload))

    def run(self):
        worker = threading.Thread(target=self.trace, daemon=True)
        worker.start()
        try:
            self.read()
        except Broken as broken:
            self.try_to_send(wire.fault_to_display(broken.code, str(broken)))
        except Surprise as surprise:
            self.try_to_send(wire.fault_to_display(wire.FAULTS.index("Malformed"), str(surprise)))
        except OSError:
            pass
        finally:
            with self.changed:
                self.ended = True
                self.changed.notify_all()
            worker.join()
            self.connection.close()

    def try_to_send(self, payload):
        try:
            self.send(payload)
        except OSError:
            pass

    def read(self):
        while True:
            header = self.take(4)
            if header is None:
                return
            length = int.from_bytes(header, "little")
            if length > wire.MAX_FRAME:
                raise Broken("Limit", f"a frame of {length} bytes")
            payload = self.take(length)
            if payload is None:
                return
            name, fields = wire.unpack_to_server(payload)
            if name in ("Goodbye", "Fault"):
                return
            self.receive(name, fields)

    def take(self, count):
        """So many bytes, or None if the display has left."""
        data = bytearray()
        while len(data) < count:
            more = self.connection.recv(count - len(data))
            if not more:
                return None
            data += more
        return bytes(data)

    def receive(self, name, fields):
        if name == "Hello":
            self.expect("greeting", name)
            if fields["min_version"] > 1 or fields["max_version"] < 1:
                raise Broken("Version", "this server speaks version 1")
            self.seed, self.phase = fields["seed"], "scene"
            self.send(wire.welcome(1, "edge_point_server.py", "direct", CREDITS, MAX_BATCH))
        elif self.phase == "greeting":
            raise Broken("OutOfOrder", "the first message is not Hello")
        elif name == "Ping":
            self.send(wire.pong(fields["token"]))
        elif name == "SceneBegin":
            self.expect("scene", name)
            if fields["bytes"] > MAX_SCENE:
                raise Broken("Limit", f"scenes have at most {MAX_SCENE} bytes here")
            self.digest, self.wanted, self.phase = fields["digest"], fields["bytes"], "chunks"
        elif name == "SceneChunk":
            self.expect("chunks", name)
            self.add_chunk(fields["data"])
        elif name == "Shadows":
            raise Broken("OutOfOrder", "version 1 has no Shadows")
        else:
            self.expect("ready", name)
            with self.changed:
                getattr(self, name.lower())(**fields)

    def expect(self, phase, name):
        if self.phase != phase:
            raise Broken("OutOfOrder", f"{name} has no place here")

    def add_chunk(self, data):
        self.data += data
        if len(self.data) > self.wanted:
            raise Broken("Limit", "more bytes than were announced")
        if len(self.data) < self.wanted:
            return
        whole = bytes(self.data)
        if blake3(whole) != self.digest:
            raise Broken("Malformed", "the scene has another digest")
        tables = wire.unpack_scene(whole)
        try:
            self.scene = tracer.Scene(tables)
        except IndexError:
            raise Broken("Value", "an index of the scene is past its table") from None
        self.phase = "ready"
        self.send(wire.scene_ready(self.digest))

    # Messages of a session that is ready, with the lock held.

    def view(self, view, **camera):
        if self.views and view <= next(reversed(self.views)):
            raise Broken("OutOfOrder", f"view {view} is not newer than the last")
        self.views[view] = Pinhole(camera)
        if len(self.views) > VIEWS:
            self.views.popitem(last=False)

    def request(self, view, samples):
        if view < self.cancelled or view not in self.views:
            raise Broken("OutOfOrder", f"view {view} is not known")
        if len(samples) > MAX_BATCH or len(self.held) + len(samples) > CREDITS:
            raise Broken("Limit", f"{len(samples)} requests on top of {len(self.held)}")
        for sample in samples:
            number, x, y, _ = sample
            pinhole = self.views[view]
            if x >= pinhole.width or y >= pinhole.height:
                raise Broken("Value", f"request {number} is outside the image")
            if number in self.held:
                raise Broken("Value", f"request {number} came twice")
            self.held[number] = view
        # Newer messages are wanted more than older ones.
        self.waiting.appendleft((view, collections.deque(samples)))
        self.changed.notify_all()

    def edit(self, epoch, objects, lights):
        if epoch != self.epoch + 1:
            raise Broken("OutOfOrder", f"epoch {epoch} does not follow {self.epoch}")
        for index, _ in objects:
            if index >= len(self.scene.objects):
                raise Broken("Value", f"object {index} is past the scene's table")
        for index, light in lights:
            known = self.scene.lights[index:index + 1]
            if not known or known[0].kind != light[0]:
                raise Broken("Value", f"light {index} is not of this kind")
        self.scene = self.scene.edited(objects, lights)
        self.epoch, self.told = epoch, set()

    def cancel(self, views_before):
        self.cancelled = max(self.cancelled, views_before)
        self.held = {number: view for number, view in self.held.items() if view >= self.cancelled}
        self.waiting = collections.deque(w for w in self.waiting if w[0] >= self.cancelled)
        self.send(wire.status(len(self.held), self.traced, 0, self.cancelled))

    # The other thread.

    def trace(self):
        while True:
            with self.changed:
                while not self.waiting and not self.ended:
                    self.changed.wait()
                if self.ended:
                    return
                view, samples = self.waiting[0]
                portion = [samples.popleft() for _ in range(min(PORTION, len(samples)))]
                if not samples:
                    self.waiting.popleft()
                scene, epoch, pinhole = self.scene, self.epoch, self.views.get(view)
            if pinhole:
                self.answer(view, epoch, [(s[0], *self.sample(scene, pinhole, s)) for s in portion])

    def sample(self, scene, pinhole, wanted):
        number, x, y, offset = wanted
        direction = pinhole.direction(x + offset[0], y + offset[1])
        return scene.shade(self.seed, number, pinhole.eye, direction)

    def answer(self, view, epoch, shaded):
        with self.changed:
            # What was traced before an edit is of its epoch, and as good as it was.
            news = set()
            if epoch == self.epoch:
                news = set().union(*(triples for _, _, triples in shaded)) - self.told
            self.told |= news
            kept = [wire.sample(number, *fields) for number, fields, _ in shaded
                    if self.held.pop(number, None) is not None]
            self.traced += len(kept)
            try:
                if news:
                    self.send(wire.triples(epoch, sorted(news)))
                if kept:
                    self.send(wire.samples(view, epoch, kept))
            except OSError:
                self.ended = True


class Pinhole:
    """A camera, as section 3 of PROTOCOL.md has its rays."""

    def __init__(self, camera):
        self.eye, self.width, self.height = camera["eye"], camera["width"], camera["height"]
        self.forward = tracer.unit(tracer.sub(camera["target"], self.eye))
        self.right = tracer.unit(tracer.cross(self.forward, camera["up"]))
        self.up = tracer.cross(self.right, self.forward)
        self.tangent = math.tan(math.radians(camera["fov_y"]) / 2)

    def direction(self, x, y):
        across = (2 * x / self.width - 1) * self.tangent * self.width / self.height
        upwards = (1 - 2 * y / self.height) * self.tangent
        aside = tracer.add(tracer.scale(self.right, across), tracer.scale(self.up, upwards))
        return tracer.unit(tracer.add(self.forward, aside))


def listen(address):
    host, _, port = address.rpartition(":")
    if host not in ("127.0.0.1", "localhost"):
        raise SystemExit(f"{address} is not a loopback address; use 127.0.0.1")
    listener = socket.create_server((host, int(port)))
    print(f"listening on {host}:{listener.getsockname()[1]}", flush=True)
    return listener


def serve(listener):
    while True:
        connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=Session(connection).run, daemon=True).start()


def main(arguments):
    address, waits = "127.0.0.1:0", False
    while arguments:
        option = arguments.pop(0)
        if option == "--listen" and arguments:
            address = arguments.pop(0)
        elif option == "--parent-stdin":
            waits = True
        elif option == "--threads" and arguments:
            arguments.pop(0)
        else:
            print(__doc__)
            return 0 if option in ("-h", "--help") else 2
    listener = listen(address)
    if not waits:
        serve(listener)
    threading.Thread(target=serve, args=(listener,), daemon=True).start()
    # The parent has ended when its end of the pipe is closed.
    while os.read(sys.stdin.fileno(), 4096):
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
