"""Sums of the images of Photron recordings, as pyMRAW reads them.

    sum_photron.py RECORDING...  > expected.csv

One line per image: the sum of its counts, the sum of counts times their number in the image
(from 1, row by row), so that no two pixels can change places, and the largest count.
"""

import sys
import warnings
from pathlib import Path

import numpy as np
import pyMRAW


def main():
    warnings.simplefilter("ignore")  # about bit depths other than 12
    print("recording,image,sum,weighted_sum,maximum")
    for recording in sys.argv[1:]:
        images, _ = pyMRAW.load_video(recording)
        for number, image in enumerate(images):
            counts = image.astype(np.int64).ravel()
            weights = np.arange(1, counts.size + 1)
            sums = f"{counts.sum()},{(weights * counts).sum()},{counts.max()}"
            print(f"{Path(recording).name},{number},{sums}")


if __name__ == "__main__":
    main()
