#!/usr/bin/env python3
"""Writes the seed inputs of the fuzz targets anew: make_corpus.py HALFSHADE_PROGRAM (from anywhere).

The seeds are in the tree so that no build needs this; run it after changing what a target reads. Pictures come from
Pillow and from halfshade itself, texts and scenes from here. Equal programs give equal bytes.
"""
import io
import itertools
import json
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

from PIL import Image

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


class Corpus:
    def __init__(self, target):
        self.directory = HERE / "corpus" / target
        shutil.rmtree(self.directory, ignore_errors=True)
        self.directory.mkdir(parents=True)

    def add(self, name, content):
        data = content.encode() if isinstance(content, str) else content
        (self.directory / name).write_bytes(data)


QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
LINES = [  # each after QUAD
    "f 1 2 3", "f 1 2 3 4", "f -4 -3 -2 -1", "f 1 2 99", "f 1 2 -9", "f 4294967297 2 3", "f 1/1 2/1 3/1",
    "f 1//1 2//1 3//1", "vt .5 .25\nvn 0 0 1\nf 1/1/1 2/1/1 3/-1/-1", "vt 1e10 0\nf 1 2 3", "v nan 0 0\nf 1 2 5",
    "v 1e400 1e-400 0\nf 1 2 3", "v 1e38 -1e38 1e38\nv -3e38 1 1\nf 1 5 6", "v 0 0 0 1 .5 .5 .5\nf 1 2 5",
    "v 1e-320 1e-310 0\nf 1 2 5\n", "mtllib a.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4", "mtllib none.mtl other.mtl\nf 1 2 3",
    "mtllib ../../etc/passwd\nf 1 2 3", "mtllib a.mtl\nusemtl c\nf 1 2 3", "f 1 2 \\\n3 4", "# f 1 \\\nf 1 2 3", "g a\no b\ns off\nf 1 2 3",
    "f 1 3 2 4", "f 1 1 1 1 1", "fo 1 2 3", "v .5 .5 0\nf 1 2 5 3 4", "v .5 -1 0\nf 1 5 2 3 4", "f 0 1 2", "f 1 2", "f", "v 1,5 0 0",
]


def obj():
    corpus = Corpus("obj")
    for i, line in enumerate(LINES):
        corpus.add(f"line{i:02}.obj", QUAD + line + "\n")
    corpus.add("bom.obj", b"\xef\xbb\xbf" + (QUAD + "f 1 2 3\n").encode())
    corpus.add("crlf.obj", (QUAD + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r\n"))
    corpus.add("zero.obj", QUAD.encode() + b"f 1 2 3\n\0f 1 3 4\n")
    star = [(i, 2 if i % 2 else 5) for i in range(40)]
    corpus.add("comb.obj", "".join(f"v {x} {y} 0\n" for x, y in star) + "v 39 0 0\nv 0 0 0\nf "
               + " ".join(str(i + 1) for i in range(42)) + "\n")
    spread = random.Random(1)
    corpus.add("tangle.obj", "".join(f"v {spread.random():.4f} {spread.random():.4f} {spread.random():.2f}\n"
                                     for _ in range(60)) + "f " + " ".join(str(i + 1) for i in range(60)) + "\n")
    corpus.add("interleaved.obj", "".join(f"v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf -3 -2 -1\n" for i in range(12)))


def mtl():
    corpus = Corpus("mtl")
    corpus.add("plain.mtl", "newmtl a\nKd .1 .2 .3\nd .5\nTf .1 .2 .3\nmap_Kd a.png\nmap_d a.png\nmap_Tf a.exr\n")
    for i, line in enumerate(["Kd .5", "Kd 1 2", "Kd nan 0 0", "Kd -1 0 0", "Kd 1e7 0 0", "d 2", "Tr .25", "d .5\nTr .5",
                              "map_Kd -clamp on -s 2 2 1 -o .5 0 0 a.png", "map_d ../../etc/passwd", "map_Kd none.png",
                              "map_Kd a b.png", "Kt .5 .5 .5", "illum 2\nNs 10", "newmtl a\nKd 1 1 1", "map_Kd", "d",
                              "map_Kd -bm 1 -mm 0 1 -imfchan r -type sphere a.png", "map_d -blendu off -t 1 1 1 a.exr"]):
        corpus.add(f"line{i:02}.mtl", "newmtl a\n" + line + "\n")
    corpus.add("early.mtl", "Kd 1 1 1\n")
    corpus.add("unnamed.mtl", "newmtl\nKd 1 1 1\n")
    corpus.add("blanks.mtl", "newmtl  a b \t\n\tKd\t1 1 1 # grey\nnewmtl b\\\nc\n")


CAMERA = {"eye": [0, 1, 4], "target": [0, 0, 0]}
LIGHTS = [
    {"type": "point", "position": [0, 3, 0]},
    {"type": "rectangle", "center": [0, 3, 0], "u": [1, 0, 0], "v": [0, 0, 1], "two_sided": True},
    {"type": "rectangle", "center": [0, 3, 0], "u": [1, 0, 0], "v": [0, 0, 1], "emission": "a.png"},
    {"type": "rectangle", "center": [0, 3, 0], "u": [1, 0, 0], "v": [0, 0, 1], "emission": "../a.exr"},
    {"type": "disk", "center": [0, 3, 0], "normal": [0, -1, 0], "radius": 0.5, "emission": [1, 2, 3]},
    {"type": "sphere", "center": [0, 3, 0], "radius": 1e30, "emission": 2},
    {"type": "ellipsoid", "center": [0, 3, 0], "axes": [[1, 0, 0], [0, 2, 0], [1, 1, 1]]},
    {"type": "polygon", "vertices": [[0, 3, 0], [1, 3, 0], [1, 3, 1], [0.2, 3, 0.8]]},
    {"type": "samples", "points": [[0, 3, 0], [1, 4, 1e-300]]},
    {"type": "disk", "center": [0, 0, 0], "normal": [0, 0, 0], "radius": 0},
]


def view():
    corpus = Corpus("view")
    for i, light in enumerate(LIGHTS):
        corpus.add(f"light{i}.json", json.dumps({"camera": CAMERA, "lights": [dict(light, name="key")]}))
    corpus.add("all.json", json.dumps({"camera": dict(CAMERA, up=[0, 0, 1], fov_y_deg=179),
                                       "lights": [dict(light, name=f"l{i}") for i, light in enumerate(LIGHTS[:3])]}))
    corpus.add("twice.json", json.dumps({"camera": CAMERA, "lights": [LIGHTS[0], LIGHTS[0]]}))
    corpus.add("wrong.json", json.dumps({"camera": dict(CAMERA, eye=[0, 0]), "light": []}))
    corpus.add("deep.json", "[" * 2000)
    corpus.add("numbers.json", '{"camera": {"eye": [1e999, -0, 1e-400], "target": [0, 0, 0]}, "lights": []}')
    corpus.add("text.json", '{"camera": "\\ud800\\u0000\xff", "lights": [{"name": "a/b", "type": 7}]}'.encode("latin-1"))
    for file in sorted((ROOT / "docs/views").glob("*.json")):
        corpus.add(file.name, file.read_bytes())


def encoded(image, kind, **options):
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def image(halfshade, scratch):
    corpus = Corpus("image")
    picture = Image.new("RGBA", (7, 5))
    picture.putdata([((x * 37) % 256, (x * 91) % 256, (x * 13) % 256, (x * 53) % 256) for x in range(35)])
    for mode in ("1", "L", "LA", "P", "RGB", "RGBA"):
        corpus.add(f"{mode}.png", encoded(picture.convert(mode), "PNG"))
    corpus.add("16.png", encoded(Image.new("I;16", (3, 2), 4711), "PNG"))
    corpus.add("transparent.png", encoded(picture.convert("P"), "PNG", transparency=3))
    for mode in ("L", "RGB", "CMYK"):
        corpus.add(f"{mode}.jpg", encoded(picture.convert(mode), "JPEG"))
    corpus.add("progressive.jpg", encoded(picture.convert("RGB"), "JPEG", progressive=True))
    for name, arguments in {"picture": [], "lights": ["--light-samples", "4"]}.items():
        file = scratch / f"{name}.exr"
        subprocess.run([halfshade, "render", "--size", "6x4", *arguments, "-o", str(file)], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        corpus.add(file.name, file.read_bytes())
    corpus.add("cut.exr", file.read_bytes()[:400])
    corpus.add("cut.png", encoded(picture, "PNG")[:60])
    corpus.add("cut.jpg", encoded(picture.convert("RGB"), "JPEG")[:300])
    corpus.add("other.tga", bytes([0, 0, 2] + 9 * [0] + 4 * [255] + [32, 0]))


def npy_bytes(header, data, version=b"\x01\x00"):
    header = header.ljust(118 - len(header) % 64 if len(header) > 118 else 117) + "\n"
    return b"\x93NUMPY" + version + len(header).to_bytes(2, "little") + header.encode() + data


def npy():
    corpus = Corpus("npy")
    for kind, size in {"<f8": 8, "<f4": 4, "<u4": 4, "<i4": 4, "|u1": 1}.items():
        corpus.add(f"{kind[1:]}.npy", npy_bytes(f"{{'descr': '{kind}', 'fortran_order': False, 'shape': (2, 3), }}", bytes(6 * size)))
    for i, (shape, count) in enumerate([("()", 1), ("(0,)", 0), ("(4,)", 4), ("(4)", 4), ("(1, 2, 2, 1)", 4), ("(-1,)", 0),
                                        ("(18446744073709551616,)", 0), ("(4294967296, 4294967296)", 0), ("(5,)", 4)]):
        corpus.add(f"shape{i}.npy", npy_bytes(f"{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}", bytes(count)))
    corpus.add("order.npy", npy_bytes("{'descr': '<f8', 'fortran_order': True, 'shape': (1,), }", bytes(8)))
    corpus.add("version.npy", npy_bytes("{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }", bytes(8), b"\x02\x00"))
    corpus.add("twice.npy", npy_bytes("{'descr': '<f8', 'descr': '<f8', 'shape': (1,)}", bytes(8)))
    corpus.add("cut.npy", b"\x93NUMPY\x01\x00\xff\xffab")


def solve():
    """Bytes as fuzz_solve.cpp takes them: method, light samples, pattern, sets, switches, light shape, and so on."""
    corpus = Corpus("solve")
    for number, (method, shape) in enumerate(itertools.product(range(5), range(7))):
        draw = random.Random(number)
        head = [method, 1 + number % 6, draw.randrange(5), draw.randrange(3), draw.randrange(256), shape]
        body = [draw.randrange(193) if draw.random() < 0.97 else draw.randrange(256) for _ in range(360)]
        corpus.add(f"{method}{shape}", bytes(head + body))


def c_api():
    """Bytes as fuzz_c_api.cpp takes them. Numbers above 192 are rare, as they stand for extreme coordinates."""
    corpus = Corpus("c_api")
    for number in range(24):
        draw = random.Random(1000 + number)
        calls = [draw.randrange(193) if draw.random() < 0.98 else draw.randrange(256) for _ in range(700)]
        corpus.add(f"calls{number:02}", bytes(calls))


def main():
    halfshade = str(pathlib.Path(sys.argv[1]).resolve())
    obj(), mtl(), view(), npy(), solve(), c_api()
    with tempfile.TemporaryDirectory() as scratch:
        image(halfshade, pathlib.Path(scratch))


if __name__ == "__main__":
    main()
