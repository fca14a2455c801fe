"""A shader server's side of a connection, from PROTOCOL.md alone: what may be said when, and what is held. It knows nothing of shading.

A shader is an object with `name`, `says` (what it shades with), `credits`, `max_batch`, `portion` (samples traced together at most)
and `build(tables)`, which makes a scene of the tables of `wire.unpack_scene`. A scene has `edited(objects, lights)`, which makes
another of it, and `trace(seed, pinhole, requests)`, which gives the requests' samples packed one after another in their
order and a set of triples. They are called by one thread a display.
"""

import collections
import math
import select
import socket
import threading
import time

import values
import wire
from values import Broken, cross, length
from wire import Surprise

VERSIONS = (1, 3)
VIEWS = 256
MAX_SCENE = 256 << 20
# Scenes kept for displays to come.
HELD = 4
# Time for a display's first message, and for it to leave after a fault, seconds.
GREETING, FAREWELL = 10, 2
# Messages that may wait to be written before no more are read.
ROOM = 256


class Pinhole:
    """A camera, as section 3 of PROTOCOL.md has its rays."""

    def __init__(self, camera):
        self.eye, self.width, self.height = camera["eye"], camera["width"], camera["height"]
        self.forward = unit(values.sub(camera["target"], self.eye))
        self.right = unit(cross(self.forward, camera["up"]))
        self.up = cross(self.right, self.forward)
        self.tangent = math.tan(math.radians(camera["fov_y"]) / 2)

    def direction(self, x, y):
        across = (2 * x / self.width - 1) * self.tangent * self.width / self.height
        upwards = (1 - 2 * y / self.height) * self.tangent
        return unit([f + r * across + u * upwards for f, r, u in zip(self.forward, self.right, self.up)])


def unit(a):
    size = length(a)
    return tuple(c / size for c in a)


class Store:
    """What all displays share: the shader, and the scenes that were built last."""

    def __init__(self, shader, digest):
        self.shader, self.digest = shader, digest
        self.lock, self.scenes = threading.Lock(), collections.OrderedDict()

    def held(self):
        with self.lock:
            return list(self.scenes)

    def find(self, digest):
        with self.lock:
            return self.scenes.get(digest)

    def keep(self, digest, built):
        with self.lock:
            self.scenes[digest] = built
            self.scenes.move_to_end(digest)
            while len(self.scenes) > HELD:
                self.scenes.popitem(last=False)


class Session:
    """One display. One thread reads, one writes, and one builds and traces, so that none waits for another."""

    def __init__(self, connection, store):
        self.connection, self.store, self.shader = connection, store, store.shader
        self.changed = threading.Condition()
        self.outgoing, self.ended = collections.deque(), False
        self.phase, self.version, self.wished, self.seed = "greeting", 0, False, 0
        self.holds, self.digest, self.announced, self.data = [], b"", 0, bytearray()
        self.kinds, self.things = [], 0
        self.epoch, self.views, self.held, self.cancelled, self.traced = 0, collections.OrderedDict(), {}, 0, 0
        # For the thread that traces: a scene to build, edits and requests.
        self.to_build, self.edits, self.waiting = None, collections.deque(), collections.deque()

    def run(self):
        threads = [threading.Thread(target=work, daemon=True) for work in (self.write, self.work)]
        for thread in threads:
            thread.start()
        try:
            self.read()
        except Broken as broken:
            self.close(broken)
        except Surprise as surprise:
            self.close(Broken("Malformed", str(surprise)))
        except OSError:
            pass
        self.close()
        for thread in threads:
            thread.join()
        self.connection.close()

    def close(self, broken=None):
        """Takes nothing more; says which rule was broken, if one was."""
        with self.changed:
            if not self.ended and broken:
                self.outgoing.append(wire.fault_to_display(broken.code, str(broken)[:values.MAX_TEXT // 4]))
            self.ended = True
            self.waiting.clear()
            self.changed.notify_all()

    def send(self, payload):
        """Queues a message. With the lock held or not."""
        with self.changed:
            if not self.ended:
                self.outgoing.append(payload)
                self.changed.notify_all()

    # The thread that writes.

    def write(self):
        try:
            while True:
                with self.changed:
                    while not self.outgoing and not self.ended:
                        self.changed.wait()
                    payloads = list(self.outgoing)
                    self.outgoing.clear()
                    self.changed.notify_all()
                if not payloads:
                    break
                self.connection.sendall(b"".join(map(wire.frame, payloads)))
            self.connection.shutdown(socket.SHUT_WR)
        except OSError:
            self.close()

    # The thread that reads.

    def read(self):
        """Until the display leaves; after a fault what it says is thrown away, for a while."""
        poll = select.poll()
        poll.register(self.connection, select.POLLIN)
        buffer, start, farewell = bytearray(), time.monotonic(), None
        while True:
            with self.changed:
                while len(self.outgoing) > ROOM and not self.ended:
                    self.changed.wait()
                ended = self.ended
            if ended:
                farewell = farewell or time.monotonic() + FAREWELL
                if time.monotonic() > farewell:
                    return
            if not poll.poll(200):
                if self.phase == "greeting" and time.monotonic() - start > GREETING:
                    raise Broken("OutOfOrder", f"no Hello within {GREETING} s")
                continue
            more = self.connection.recv(1 << 18)
            if not more:
                return
            if not ended:
                buffer += more
                try:
                    self.read_frames(buffer)
                except Broken as broken:
                    self.close(broken)
                except Surprise as surprise:
                    self.close(Broken("Malformed", str(surprise)))

    def read_frames(self, buffer):
        """Takes whole frames off the front."""
        at = 0
        while len(buffer) - at >= 4 and not self.ended:
            size = int.from_bytes(buffer[at:at + 4], "little")
            if size > wire.MAX_FRAME:
                raise Broken("Limit", f"a frame of {size} bytes")
            if len(buffer) - at - 4 < size:
                break
            name, fields = wire.unpack_to_server(bytes(buffer[at + 4:at + 4 + size]))
            at += 4 + size
            values.check_message(name, fields)
            if name in ("Goodbye", "Fault"):
                return self.close()
            self.receive(name, fields)
        del buffer[:at]

    def receive(self, name, fields):
        if name == "Hello":
            self.expect("greeting", name)
            self.greet(**fields)
        elif self.phase == "greeting":
            raise Broken("OutOfOrder", "the first message is not Hello")
        elif name == "Ping":
            self.send(wire.pong(fields["token"]))
        elif name == "Shadows":
            if self.version < 3 or self.wished or self.phase != "scene":
                raise Broken("OutOfOrder", "Shadows comes once, before the scene, from version 3 on")
            # No sample is ever provisional here, and there is but one way to find what a light reaches.
            self.wished = True
        elif name == "SceneBegin":
            self.expect("scene", name)
            self.begin(**fields)
        elif name == "SceneChunk":
            self.expect("chunks", name)
            self.data += fields["data"]
            if len(self.data) > self.announced:
                raise Broken("Limit", "more bytes than were announced")
            if len(self.data) == self.announced:
                self.build(bytes(self.data))
                self.data = bytearray()
        else:
            self.expect("ready", name)
            with self.changed:
                getattr(self, name.lower())(**fields)
                self.changed.notify_all()

    def expect(self, phase, name):
        if self.phase != phase:
            raise Broken("OutOfOrder", f"{name} has no place here")

    def greet(self, min_version, max_version, name, seed):
        self.version = min(max_version, VERSIONS[1])
        if self.version < max(min_version, VERSIONS[0]):
            raise Broken("Version", f"this server speaks versions {VERSIONS[0]} to {VERSIONS[1]}")
        self.seed, self.phase, self.holds = seed, "scene", self.store.held()
        shader = self.shader
        self.send(wire.welcome(self.version, shader.name, shader.says, shader.credits, shader.max_batch, self.holds))

    def begin(self, digest, bytes):
        self.digest, self.announced = digest, bytes
        if digest in self.holds:
            return self.build(None)
        if bytes > MAX_SCENE:
            raise Broken("Limit", f"scenes have at most {MAX_SCENE} bytes here")
        self.phase = "chunks"

    def build(self, data):
        with self.changed:
            self.phase, self.to_build = "building", (data,)
            self.changed.notify_all()

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
        if len(samples) > self.shader.max_batch or len(self.held) + len(samples) > self.shader.credits:
            raise Broken("Limit", f"{len(samples)} requests on top of {len(self.held)}")
        pinhole = self.views[view]
        for number, x, y, _ in samples:
            if x >= pinhole.width or y >= pinhole.height:
                raise Broken("Value", f"request {number} is outside the image")
            if number in self.held:
                raise Broken("Value", f"request {number} came twice")
            self.held[number] = view
        # Newer messages are wanted more than older ones.
        self.waiting.appendleft((view, pinhole, collections.deque(samples)))

    def edit(self, epoch, objects, lights):
        if epoch != self.epoch + 1:
            raise Broken("OutOfOrder", f"epoch {epoch} does not follow {self.epoch}")
        for index, _ in objects:
            if index >= self.things:
                raise Broken("Value", f"object {index} is past the scene's table")
        for index, light in lights:
            if self.kinds[index:index + 1] != [light[0]]:
                raise Broken("Value", f"light {index} is not of this kind")
        self.epoch = epoch
        self.edits.append((epoch, objects, lights))

    def cancel(self, views_before):
        self.cancelled = max(self.cancelled, views_before)
        self.held = {number: view for number, view in self.held.items() if view >= self.cancelled}
        self.waiting = collections.deque(w for w in self.waiting if w[0] >= self.cancelled)
        self.send(wire.status(len(self.held), self.traced, 0, self.cancelled))

    # The thread that builds and traces.

    def work(self):
        try:
            self.trace()
        except Broken as broken:
            self.close(broken)
        except Surprise as surprise:
            self.close(Broken("Malformed", str(surprise)))
        except Exception as error:
            self.close(Broken("Internal", f"{type(error).__name__}: {error}"))
            raise

    def trace(self):
        scene, epoch, told = None, 0, set()
        while True:
            with self.changed:
                while not (self.ended or self.to_build or self.edits or self.waiting) or (
                        len(self.outgoing) > ROOM and not self.ended):
                    self.changed.wait()
                if self.ended:
                    return
                to_build, self.to_build = self.to_build, None
                edits = list(self.edits)
                self.edits.clear()
                # What was asked for after an edit is traced in its epoch; what was asked for before may be too.
                view, pinhole, portion = self.take() if not to_build and not edits else (0, None, [])
            if to_build:
                scene = self.built(*to_build)
            for epoch, objects, lights in edits:
                scene, told = scene.edited(objects, lights), set()
            if portion:
                packed, triples = scene.trace(self.seed, pinhole, portion)
                self.answer(view, epoch, [r[0] for r in portion], packed, sorted(triples - told))
                told |= triples

    def take(self):
        if not self.waiting:
            return 0, None, []
        view, pinhole, _ = self.waiting[0]
        portion = []
        while self.waiting and self.waiting[0][0] == view and len(portion) < self.shader.portion:
            samples = self.waiting[0][2]
            portion += [samples.popleft() for _ in range(min(self.shader.portion - len(portion), len(samples)))]
            if not samples:
                self.waiting.popleft()
        return view, pinhole, portion

    def built(self, data):
        """The scene of these bytes, or the one that is held."""
        kept = self.store.find(self.digest)
        if data is not None:
            if self.store.digest(data) != self.digest:
                raise Broken("Malformed", "the scene has another digest")
            tables = wire.unpack_scene(data)
            values.check_scene(tables)
            kept = ([light[0] for light in tables["lights"]], len(tables["objects"]), self.shader.build(tables))
        if kept is None:
            raise Broken("Internal", "a scene that was held is gone")
        self.store.keep(self.digest, kept)
        self.kinds, self.things, scene = kept
        with self.changed:
            self.phase = "ready"
            self.send(wire.scene_ready(self.digest))
        return scene

    def answer(self, view, epoch, numbers, packed, triples):
        size = wire.SAMPLE
        with self.changed:
            # What was cancelled meanwhile is no longer held.
            kept = [i for i, number in enumerate(numbers) if self.held.pop(number, None) is not None]
            if len(kept) < len(numbers):
                packed = b"".join(packed[i * size:(i + 1) * size] for i in kept)
            self.traced += len(kept)
            if triples:
                self.send(wire.triples(epoch, triples))
            if kept:
                self.send(wire.samples(view, epoch, len(kept), packed))
