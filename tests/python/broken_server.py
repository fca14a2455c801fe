#!/usr/bin/env python3
"""The shader server of edge_point_server.py with one thing broken, for tests of who finds it.

    broken_server.py --break KIND [options]
"""

import itertools
import struct
import sys

sys.dont_write_bytecode = True

import edge_point_server  # noqa: E402 (modules must not be compiled into the checkout)
import serving  # noqa: E402
import session  # noqa: E402
import tracer  # noqa: E402
import values  # noqa: E402
import wire  # noqa: E402
from blake3_hash import blake3  # noqa: E402

Session = session.Session
KINDS = {}


def kind(make):
    """Makes a way to break the server: a function that patches modules."""
    KINDS[make.__name__.replace("_", "-")] = make
    return make


def change_samples(change):
    """Patches what is answered; `change` gets and gives (position, thing, radiance, flags), and the ray."""
    shade = tracer.Scene.shade

    def shaded(self, seed, number, origin, direction):
        fields, triples = shade(self, seed, number, origin, direction)
        return change(fields, origin, direction, triples), triples

    tracer.Scene.shade = shaded


@kind
def nothing():
    pass


@kind
def hangs():
    Session.read_frames = lambda self, buffer: None


@kind
def other_version():
    welcome = wire.welcome
    wire.welcome = lambda version, *rest: welcome(version + 1, *rest)


@kind
def closes_without_fault():
    close = Session.close
    Session.close = lambda self, broken=None: close(self)


@kind
def wrong_fault_code():
    fault = wire.fault_to_display
    wire.fault_to_display = lambda code, text: fault(6 - code, text)


@kind
def stays_after_fault():
    def close(self, broken=None):
        if broken:
            self.send(wire.fault_to_display(broken.code, str(broken)))
        else:
            original(self)

    original, Session.close = Session.close, close


@kind
def answers_twice():
    samples = wire.samples
    wire.samples = lambda view, epoch, count, packed: samples(view, epoch, 2 * count, 2 * packed)


@kind
def loses_samples():
    def answer(self, view, epoch, numbers, packed, triples):
        if 7 in numbers:
            at = numbers.index(7)
            numbers, packed = numbers[:at] + numbers[at + 1:], packed[:40 * at] + packed[40 * at + 40:]
        original(self, view, epoch, numbers, packed, triples)

    original, Session.answer = Session.answer, answer


@kind
def off_the_ray():
    change_samples(lambda f, o, d, t: ((f[0][0] + 0.01, *f[0][1:]), *f[1:]))


@kind
def too_far():
    change_samples(lambda f, o, d, t: (tracer.add(f[0], tracer.scale(d, 0.02)), *f[1:]))


@kind
def wrong_object():
    change_samples(lambda f, o, d, t: (f[0], 1 if f[1] == 2 else f[1], *f[2:]))


@kind
def lights_are_objects():
    change_samples(lambda f, o, d, t: (*f[:3], f[3] & ~wire.LIGHT))


@kind
def too_dark():
    change_samples(lambda f, o, d, t: (*f[:2], tracer.scale(f[2], 0.99), f[3]))


@kind
def light_leaks():
    change_samples(lambda f, o, d, t: (*f[:2], tracer.scale(f[2], 1.001 if t else 1), f[3]))


@kind
def not_a_number():
    change_samples(lambda f, o, d, t: (*f[:2], (float("nan"),) * 3, f[3]))


@kind
def never_the_same():
    counter = itertools.count()
    random = tracer.random.Random
    tracer.random.Random = lambda seed: random(seed + next(counter))


@kind
def flat_pixels():
    Session_direction = session.Pinhole.direction
    session.Pinhole.direction = lambda self, x, y: Session_direction(self, int(x) + 0.5, int(y) + 0.5)


@kind
def upside_down_maps():
    look = tracer.Texture.look
    tracer.Texture.look = lambda self, u, v: look(self, u, -v)


@kind
def flat_normals():
    tracer.Triangle.shading_normal = lambda self, at: self.normal


@kind
def late_triples():
    def answer(self, view, epoch, numbers, packed, triples):
        original(self, view, epoch, numbers, packed, [])
        if triples:
            self.send(wire.triples(epoch, triples))

    original, Session.answer = Session.answer, answer


@kind
def repeated_triples():
    def answer(self, view, epoch, numbers, packed, triples):
        original(self, view, epoch, numbers, packed, [(0, 1, 0), *triples])

    original, Session.answer = Session.answer, answer


@kind
def swapped_triples():
    triples = wire.triples
    wire.triples = lambda epoch, found: triples(epoch, [(a, c, b) for a, b, c in found])


@kind
def ignores_edits():
    tracer.Scene.edited = lambda self, objects, lights: self


@kind
def old_epochs():
    samples = wire.samples
    wire.samples = lambda view, epoch, *rest: samples(view, 0, *rest)


@kind
def edits_what_is_held():
    def edited(self, objects, lights):
        self.__dict__.update(original(self, objects, lights).__dict__)
        return self

    original, tracer.Scene.edited = tracer.Scene.edited, edited


@kind
def takes_any_epoch():
    def edit(self, epoch, objects, lights):
        self.epoch = epoch - 1
        original(self, epoch, objects, lights)

    original, Session.edit = Session.edit, edit


@kind
def cancels_nothing():
    def cancel(self, views_before):
        self.cancelled = max(self.cancelled, views_before)
        self.send(wire.status(len(self.held), self.traced, 0, self.cancelled))

    Session.cancel = cancel


@kind
def confirms_no_cancel():
    def cancel(self, views_before):
        send, self.send = self.send, lambda payload: None
        original(self, views_before)
        self.send = send

    original, Session.cancel = Session.cancel, cancel


@kind
def keeps_credits():
    def cancel(self, views_before):
        held = len(self.held)
        original(self, views_before)
        self.held.update({("lost", i): self.cancelled for i in range(held - len(self.held))})

    original, Session.cancel = Session.cancel, cancel


@kind
def no_credit_limit():
    Shader = edge_point_server.Shader
    welcome = wire.welcome
    wire.welcome = lambda version, name, says, credits, *rest: welcome(version, name, says, 4096, *rest)
    Shader.credits = 1 << 30


@kind
def forgets_views():
    session.VIEWS = 16


@kind
def remembers_views():
    session.VIEWS = 1 << 30


@kind
def no_value_checks():
    values.within = lambda *rest: None
    values.in_table = lambda *rest: None


@kind
def trusts_frames():
    wire.MAX_FRAME = 1 << 40


@kind
def ignores_trailing_bytes():
    def whole(payload, messages):
        reader = wire.Reader(payload)
        name, unpack = messages[reader.variant(len(messages))]
        return name, unpack(reader)

    wire._whole = whole


@kind
def ignores_digests():
    def built(self, data):
        if data is not None:
            self.digest = blake3(data)
        return original(self, data)

    original, Session.built = Session.built, built


@kind
def pings_wait_their_turn():
    """A ping is answered after what was asked for before it."""
    def receive(self, name, fields):
        if name == "Ping":
            with self.changed:
                while (self.held or self.phase == "building") and not self.ended:
                    self.changed.wait()
        original(self, name, fields)

    def answer(self, *rest):
        original_answer(self, *rest)
        with self.changed:
            self.changed.notify_all()

    original, Session.receive = Session.receive, receive
    original_answer, Session.answer = Session.answer, answer


@kind
def one_display_at_a_time():
    def accept(listener, secret, store):
        while True:
            serving.attend(listener.accept()[0], secret, True, store)

    serving.accept = accept


@kind
def one_message_a_read():
    """Takes what one read gives for one message."""
    def read_frames(self, buffer):
        size = struct.unpack("<I", buffer[:4].ljust(4, b"\0"))[0]
        try:
            original(self, bytearray(buffer[:4 + size]))
        finally:
            buffer.clear()

    original, Session.read_frames = Session.read_frames, read_frames


def main(arguments):
    if len(arguments) < 2 or arguments[0] != "--break" or arguments[1] not in KINDS:
        print(__doc__ + "\nkinds: " + " ".join(KINDS))
        return 2
    KINDS[arguments[1]]()
    return edge_point_server.main(arguments[2:])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
