#!/usr/bin/env python3
"""Recomputes mask bits of a dump (halfshade render --dump DIR) from its arrays alone, and counts the wrong ones.

It shares no code with the project; all it knows is this definition:

  A triangle blocks the segment from receiver r to light sample l where r and l lie strictly on opposite sides of its
  plane, the segment meets the closed triangle, and the triangle is not the receiver's own. An alpha-tested triangle
  blocks only where the texel at the hit is opaque (alpha / 255 >= cutoff): column floor(u * width), row counted from
  the picture's bottom floor(v * height), both repeating, with u, v rounded to multiples of 2^-32.

All points are multiples of 2^-38, so they are integers here. With A, B, C, S the corners and the sample relative to r:

  D = det(A, B, C)                                     its sign is the side on which r lies
  w = (det(S, B, C), det(A, S, C), det(A, B, S))       barycentric weights of the hit, times sum(w)
  blocked  <=>  D != 0, and with the signs flipped where D < 0:  w >= 0 and sum(w) > |D|

Doubles with an error bound decide the clear cases, Python's integers the others.
Exit code: 0 every checked bit is right, 1 some are wrong, 2 the dump cannot be read, 77 numpy is missing.
"""

import argparse
import ctypes
import ctypes.util
import json
import pathlib
import sys
from fractions import Fraction

try:
    import numpy as np
except ImportError:
    print("check_dump: skipped, this python3 has no numpy")
    sys.exit(77)

NONE = 0xFFFFFFFF
UNITS_PER_ONE = 2.0**38  # lattice units in a length of 1
UV_PER_ONE = 2.0**32
# Rounding errors of a 3x3 determinant stay below 5 units of 2^-53 of the sum of its terms' magnitudes, whatever the
# order of the sums and with or without fused operations; sums of four determinants below 9. 32 leaves room.
BOUND = 32.0 * 2.0**-53
CHUNK = 2048  # triangles looked at together, for the size of the working arrays


class BadDump(Exception):
    pass


def integers(values, name):
    """Lattice points as doubles that hold whole numbers of units; differences of two are exact."""
    units = values * UNITS_PER_ONE
    if not np.all(np.isfinite(values)) or np.any(units != np.rint(units)) or np.any(np.abs(values) > 2.0):
        raise BadDump(f"{name}: a value is not on the lattice of 2^-38 in [-2, 2]")
    return units


def find_xxh3_128():
    """A function from bytes to 32 hexadecimal digits: python3-xxhash, or the C library by itself, or None."""
    try:
        import xxhash
        return xxhash.xxh3_128_hexdigest
    except ImportError:
        name = ctypes.util.find_library("xxhash")

    class Digest(ctypes.Structure):
        _fields_ = [("low", ctypes.c_uint64), ("high", ctypes.c_uint64)]

    if name is None or not hasattr(ctypes.CDLL(name), "XXH3_128bits"):
        return None
    function = ctypes.CDLL(name).XXH3_128bits
    function.restype, function.argtypes = Digest, [ctypes.c_char_p, ctypes.c_size_t]

    def hexdigest(content):
        digest = function(content, len(content))
        return f"{digest.high:016x}{digest.low:016x}"

    return hexdigest


class Dump:
    def __init__(self, directory):
        self.directory = directory
        self.about = json.loads((directory / "dump.json").read_text())
        counts = self.about["counts"]
        r, t, n, s = (counts[k] for k in ("receivers", "triangles", "samples", "sets"))
        self.receivers = integers(self.array("receivers", "<f8", (r, 3)), "receivers.npy")
        self.triangles = integers(self.array("triangles", "<f8", (t, 3, 3)), "triangles.npy")
        self.samples = integers(self.array("light_samples", "<f8", (s, n, 3)), "light_samples.npy")
        self.own = self.array("receiver_triangles", "<u4", (r,))
        self.sets = self.array("receiver_sets", "|u1", (r,))
        masks = self.array("masks", "|u1", (r, (n + 7) // 8))
        bits = np.unpackbits(masks, axis=1, bitorder="little").astype(bool)
        if np.any(bits[:, n:]):
            raise BadDump("masks.npy: a bit beyond the last sample is set")
        self.blocked = bits[:, :n]
        if r and (self.sets.max() >= s or np.any((self.own >= t) & (self.own != NONE))):
            raise BadDump("receiver_sets.npy or receiver_triangles.npy: an index is out of range")
        self.low, self.high = self.triangles.min(axis=1), self.triangles.max(axis=1)
        self.read_alpha(t)

    def array(self, name, dtype, shape):
        values = np.load(self.directory / f"{name}.npy", allow_pickle=False)
        if values.dtype.str != dtype or any(want not in (None, got) for want, got in zip(shape, values.shape, strict=True)):
            raise BadDump(f"{name}.npy: {values.dtype.str} {values.shape}, expected {dtype} {shape}")
        return values

    def read_alpha(self, triangle_count):
        self.map_of = np.full(triangle_count, -1, dtype=np.int32)
        self.maps, self.thresholds = [], []
        if not (self.directory / "triangle_alpha.npy").exists():
            return
        self.map_of = self.array("triangle_alpha", "<i4", (triangle_count,))
        uvs = self.array("triangle_uvs", "<f4", (triangle_count, 3, 2)).astype(np.float64)
        self.uvs = np.rint(uvs * UV_PER_ONE)  # ties to even
        for k, cutoff in enumerate(self.about["alpha_cutoffs"]):
            self.maps.append(self.array(f"alpha_{k}", "|u1", (None, None)))
            self.thresholds.append(Fraction(cutoff) * 255)

    def mask_hash(self):
        """XXH3-128 over both counts and the masks padded to 64-bit words; None where nothing can compute it."""
        digest = find_xxh3_128()
        if digest is None:
            return None
        count, samples = self.blocked.shape
        padded = np.zeros((count, (samples + 63) // 64 * 64), dtype=bool)
        padded[:, :samples] = self.blocked
        words = np.packbits(padded, axis=1, bitorder="little")
        return digest(np.array([count, samples], dtype="<u8").tobytes() + words.tobytes())


def det(a, b, c):
    return (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]))


def whole(vector):
    return [int(x) for x in vector]


class Corners:
    """Triangles relative to one receiver: D, its sign, the vectors that give w as dot products with S, error bounds."""

    def __init__(self, corners, reach):
        """corners [k, 3, 3]; reach [3]: the largest |S| per axis."""
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        self.corners = corners
        pairs = ((b, c), (c, a), (a, b))
        vectors = np.stack([np.cross(p, q) for p, q in pairs], axis=1)
        sizes = np.stack([self.permanent(p, q) for p, q in pairs], axis=1)  # magnitudes of the terms
        d = np.einsum("ki,ki->k", a, vectors[:, 0])
        d_error = BOUND * np.einsum("ki,ki->k", np.abs(a), sizes[:, 0])
        self.sign = np.where(d > d_error, 1, np.where(d < -d_error, -1, 0))
        for k in np.flatnonzero(self.sign == 0):
            exact = det(*(whole(p) for p in corners[k]))
            self.sign[k] = (exact > 0) - (exact < 0)
        self.vectors = vectors * self.sign[:, None, None]
        self.d = np.abs(d)
        self.w_error = BOUND * (sizes @ reach)
        self.sum_error = self.w_error.sum(axis=1) + d_error

    @staticmethod
    def permanent(p, q):
        p, q = np.abs(p), np.abs(q)
        return np.stack([p[:, i] * q[:, j] + p[:, j] * q[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)

    def take(self, keep):
        for name in ("corners", "sign", "vectors", "d", "w_error", "sum_error"):
            setattr(self, name, getattr(self, name)[keep])

    def weights(self, s):
        """w [k, 3, len(s)] and sum(w) - |D| [k, len(s)]."""
        w = self.vectors @ s.T
        return w, w.sum(axis=1) - self.d[:, None]

    def outside(self, s):
        """True [k] where one of the conditions certainly fails at every point of the convex hull of s (all are linear in S)."""
        w, beyond = self.weights(s)
        return (np.any(np.all(w < -self.w_error[:, :, None], axis=2), axis=1)
                | np.all(beyond < -self.sum_error[:, None], axis=1) | (self.sign == 0))

    def decide(self, s):
        """(certainly blocked, undecided), both [k, len(s)]."""
        w, beyond = self.weights(s)
        w_error, sum_error = self.w_error[:, :, None], self.sum_error[:, None]
        yes = np.all(w >= w_error, axis=1) & (beyond > sum_error)
        no = np.any(w < -w_error, axis=1) | (beyond < -sum_error)
        return yes, ~(yes | no)


def exact_weights(corners, s):
    """The three integers w, with the signs of D > 0, or None where the triangle does not block S."""
    a, b, c, s = *(whole(p) for p in corners), whole(s)
    d = det(a, b, c)
    w = (det(s, b, c), det(a, s, c), det(a, b, s))
    if d < 0:
        d, w = -d, tuple(-x for x in w)
    return w if d != 0 and min(w) >= 0 and sum(w) > d else None


class Checker:
    def __init__(self, dump):
        self.dump = dump
        self.pairs = self.exact = self.texels = 0

    def opaque(self, triangle, w):
        """The texel at sum(w_i uv_i) / sum(w_i): integer division rounds down, as floor does."""
        texels = self.dump.maps[self.dump.map_of[triangle]]
        height, width = texels.shape
        uv = [whole(corner) for corner in self.dump.uvs[triangle]]
        column, up = (sum(x * corner[axis] for x, corner in zip(w, uv)) * size // (sum(w) << 32) % size
                      for axis, size in ((0, width), (1, height)))
        self.texels += 1
        return int(texels[height - 1 - up, column]) >= self.dump.thresholds[self.dump.map_of[triangle]]

    def candidates(self, r, samples, own):
        """Triangles whose bounding boxes meet the box around receiver and samples."""
        low, high = np.minimum(samples.min(axis=0), r), np.maximum(samples.max(axis=0), r)
        near = np.all(self.dump.low <= high, axis=1) & np.all(self.dump.high >= low, axis=1)
        if own != NONE:
            near[own] = False
        return np.flatnonzero(near)

    def block_undecided(self, ids, group, s, undecided, blocked):
        for k, i in zip(*np.nonzero(undecided)):
            if not blocked[i]:
                self.exact += 1
                w = exact_weights(group.corners[k], s[i])
                if w is not None and (self.dump.map_of[ids[k]] < 0 or self.opaque(ids[k], w)):
                    blocked[i] = True

    def mask(self, receiver):
        dump = self.dump
        r, samples = dump.receivers[receiver], dump.samples[dump.sets[receiver]]
        s = samples - r
        low, high = s.min(axis=0), s.max(axis=0)
        box = np.array([[(low, high)[(i >> axis) & 1][axis] for axis in range(3)] for i in range(8)])
        blocked = np.zeros(len(s), dtype=bool)
        later = []
        ids = self.candidates(r, samples, dump.own[receiver])
        for first in range(0, len(ids), CHUNK):
            part = ids[first:first + CHUNK]
            group = Corners(dump.triangles[part] - r, np.abs(s).max(axis=0))
            keep = ~group.outside(box)
            part = part[keep]
            group.take(keep)
            self.pairs += len(part) * len(s)
            yes, undecided = group.decide(s)
            perforated = dump.map_of[part] >= 0
            blocked |= np.any(yes[~perforated], axis=0)
            undecided |= yes & perforated[:, None]  # these need the texel, and so the exact weights
            if undecided.any():
                later.append((part, group, undecided))
        for part, group, undecided in later:
            self.block_undecided(part, group, s, undecided, blocked)
        return blocked


def arguments():
    parser = argparse.ArgumentParser(description="Check mask bits of a dump with an independent program.")
    parser.add_argument("dump", type=pathlib.Path)
    parser.add_argument("--receivers", type=int, default=200, help="how many, chosen at random (200)")
    parser.add_argument("--seed", type=int, default=1, help="of that choice (1)")
    return parser.parse_args()


def check(options):
    dump = Dump(options.dump)
    checker = Checker(dump)
    count = len(dump.receivers)
    chosen = np.random.default_rng(options.seed).choice(count, size=min(options.receivers, count), replace=False)
    wrong_bits = wrong_receivers = partly = 0
    for receiver in chosen:
        mask = checker.mask(receiver)
        partly += bool(mask.any() and not mask.all())
        wrong = int(np.count_nonzero(mask != dump.blocked[receiver]))
        wrong_bits += wrong
        wrong_receivers += wrong > 0
        if wrong and wrong_receivers <= 5:
            first = int(np.flatnonzero(mask != dump.blocked[receiver])[0])
            print(f"  receiver {receiver}: {wrong} wrong bits, the first is sample {first}, which is "
                  f"{'blocked' if mask[first] else 'not blocked'}")
    print(f"checked    {len(chosen)} of {count} receivers ({partly} in penumbra), {len(chosen) * dump.blocked.shape[1]} bits")
    print(f"decisions  {checker.pairs} by doubles, {checker.exact} by integers, {checker.texels} texels")
    print(f"wrong      {wrong_bits} bits in {wrong_receivers} receivers")
    digest = dump.mask_hash()
    if digest is None:
        print("mask hash  not checked (neither python3-xxhash nor libxxhash is here)")
    else:
        print(f"mask hash  {'right' if digest == dump.about['mask_hash'] else 'WRONG: ' + digest}")
    return 0 if wrong_bits == 0 and digest in (None, dump.about["mask_hash"]) else 1


def main():
    try:
        return check(arguments())
    except (BadDump, OSError, ValueError, KeyError) as error:
        print(f"check_dump: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
