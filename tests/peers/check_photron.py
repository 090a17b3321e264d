"""Assert that pyMRAW and `phasewalk` read the same counts from camera recordings.

    check_photron.py PHOTRON_FRAMES DIR RECORDING...

PHOTRON_FRAMES is the example of that name, compiled; DIR takes what is written. Recordings that it
writes from arrays must come back from pyMRAW image for image, and so must every RECORDING.
"""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pyMRAW

SHAPES = [(1, 1, 2), (5, 6, 7), (3, 100, 333), (7, 368, 640)]
RATE_HZ, SHUTTER_S, COMMENT = 60000.0, 1.25e-6, "one & two < three"


def expect(condition, what):
    """An assertion that `python -O` keeps and that says what it is about."""
    if not condition:
        sys.exit(f"check_photron.py: not so: {what}")


def convert(program, source, target, *options):
    subprocess.run([program, source, target, *options], check=True)


def check_written(program, folder, shape, bits, extension):
    """A recording of random counts, full scale among them; returns its number of images."""
    counts = np.random.default_rng(bits).integers(0, 2**bits, shape, dtype=np.uint16)
    counts.flat[:2] = 0, 2**bits - 1
    source = folder / "counts.npy"
    target = folder / f"{extension}_{bits}_{shape[1]}x{shape[2]}.{extension}"
    np.save(source, counts)
    facts = {"--bits": bits, "--rate-hz": RATE_HZ, "--shutter-s": SHUTTER_S, "--comment": COMMENT}
    convert(program, source, target, *(str(word) for fact in facts.items() for word in fact))
    images, header = pyMRAW.load_video(str(target))
    expect(len(images) == shape[0], f"{target} has {shape[0]} images")
    for number, (found, wanted) in enumerate(zip(images, counts)):
        expect(np.array_equal(found, wanted), f"image {number} of {target} is what was written")
    expect(header["Record Rate(fps)"] == RATE_HZ, f"{target} keeps its rate")
    expect(header["Comment Text"] == COMMENT, f"{target} keeps its comment")
    expect(header["EffectiveBit Depth"] == bits, f"{target} keeps its bits")
    return len(images)


def check_read(program, folder, recording):
    """The same counts from both; returns the number of images."""
    target = folder / "read.npy"
    convert(program, recording, target)
    ours = np.load(target, mmap_mode="r")
    images, _ = pyMRAW.load_video(recording)
    expect(ours.dtype == np.uint16, f"counts of {recording} are uint16")
    expect(ours.shape == images.shape, f"{recording} has shape {images.shape}, not {ours.shape}")
    for number, (found, wanted) in enumerate(zip(ours, images)):
        expect(np.array_equal(found, wanted), f"image {number} of {recording} is what pyMRAW reads")
    return len(ours)


def main():
    program, folder, *recordings = sys.argv[1:]
    folder = Path(folder)
    warnings.simplefilter("ignore")  # pyMRAW's, about bit depths other than 12
    written = sum(
        check_written(program, folder, shape, bits, extension)
        for shape in SHAPES
        for bits in (8, 12, 16)
        for extension in ("cih", "cihx")
    )
    read = sum(check_read(program, folder, recording) for recording in recordings)
    print(
        f"pyMRAW {pyMRAW.__version__} reads {written} images as written here,"
        f" and the {read} images of {len(recordings)} recordings as they are read here"
    )


if __name__ == "__main__":
    main()
