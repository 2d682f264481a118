#!/usr/bin/env python3
"""Where do the masks of two dumps of the same picture differ? Writes a PNG: bits that differ per pixel, white = `--most`.

usage: mask_error_map.py DUMP_A DUMP_B OUT.png [--most BITS]
"""
import argparse
import json
import pathlib

import matplotlib.image
import numpy


def load(dump):
    about = json.loads((dump / "dump.json").read_text())
    return about, numpy.load(dump / "masks.npy"), numpy.load(dump / "receiver_pixels.npy")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("a", type=pathlib.Path)
    parser.add_argument("b", type=pathlib.Path)
    parser.add_argument("out")
    parser.add_argument("--most", type=float, default=0.0, help="bits shown as white (default: the largest number)")
    options = parser.parse_args()
    about, masks_a, pixels = load(options.a)
    _, masks_b, pixels_b = load(options.b)
    if not numpy.array_equal(pixels, pixels_b) or masks_a.shape != masks_b.shape:
        raise SystemExit("the dumps are not of the same picture and light")
    wrong = numpy.unpackbits(masks_a ^ masks_b, axis=1).sum(axis=1)
    picture = numpy.zeros(about["width"] * about["height"])
    numpy.maximum.at(picture, pixels, wrong)
    most = options.most or max(1, wrong.max())
    print(f"{int(wrong.sum())} bits differ at {int((wrong > 0).sum())} of {len(wrong)} receivers, {int(wrong.max())} at most")
    picture = numpy.clip(picture / most, 0.0, 1.0).reshape(about["height"], about["width"])
    matplotlib.image.imsave(options.out, picture, cmap="gray", vmin=0.0, vmax=1.0)


if __name__ == "__main__":
    main()
