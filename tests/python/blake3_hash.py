"""BLAKE3 of bytes, plain hashing only, after the BLAKE3 paper (O'Connor, Aumasson, Neves, Wilcox-O'Hearn, 2020)."""

import struct

IV = (
    0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A,
    0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19,
)
ORDER = (2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8)
CHUNK_START, CHUNK_END, PARENT, ROOT = 1, 2, 4, 8
BLOCK, CHUNK = 64, 1024
MASK = 0xFFFFFFFF


def _quarter(v, a, b, c, d, x, y):
    for word, right_d, right_b in ((x, 16, 12), (y, 8, 7)):
        v[a] = (v[a] + v[b] + word) & MASK
        v[d] ^= v[a]
        v[d] = (v[d] >> right_d | v[d] << (32 - right_d)) & MASK
        v[c] = (v[c] + v[d]) & MASK
        v[b] ^= v[c]
        v[b] = (v[b] >> right_b | v[b] << (32 - right_b)) & MASK


def _compress(chain, block, length, counter, flags):
    words = list(struct.unpack("<16I", block.ljust(BLOCK, b"\0")))
    v = list(chain) + list(IV[:4]) + [counter & MASK, counter >> 32, length, flags]
    for _ in range(7):
        for column in range(4):
            _quarter(v, column, 4 + column, 8 + column, 12 + column,
                     words[2 * column], words[2 * column + 1])
        for diagonal in range(4):
            _quarter(v, diagonal, 4 + (diagonal + 1) % 4, 8 + (diagonal + 2) % 4,
                     12 + (diagonal + 3) % 4, words[8 + 2 * diagonal], words[9 + 2 * diagonal])
        words = [words[i] for i in ORDER]
    return [v[i] ^ v[i + 8] for i in range(8)]


def _chunk(data, counter, root):
    chain = IV
    blocks = [data[i:i + BLOCK] for i in range(0, len(data), BLOCK)] or [b""]
    for i, block in enumerate(blocks):
        flags = (CHUNK_START if i == 0 else 0) | (CHUNK_END | root if i == len(blocks) - 1 else 0)
        chain = _compress(chain, block, len(block), counter, flags)
    return chain


def _tree(data, counter, root):
    if len(data) <= CHUNK:
        return _chunk(data, counter, root)
    # The left part is the largest power of two of whole chunks that leaves something for the right.
    left = CHUNK
    while left * 2 < len(data):
        left *= 2
    pair = _tree(data[:left], counter, 0) + _tree(data[left:], counter + left // CHUNK, 0)
    return _compress(IV, struct.pack("<16I", *pair), BLOCK, 0, PARENT | root)


def blake3(data):
    """The 32-byte digest."""
    return struct.pack("<8I", *_tree(data, 0, ROOT))
