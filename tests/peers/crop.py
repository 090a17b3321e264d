"""The square in the middle of images (..., y, x)."""


def middle(shape, side):
    """Slices of y and x; as much of the square as there is."""

    def along(length):
        taken = min(side, length)
        start = (length - taken) // 2
        return slice(start, start + taken)

    return along(shape[-2]), along(shape[-1])
