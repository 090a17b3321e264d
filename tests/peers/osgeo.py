"""Stands in for GDAL's Python package, which cannot be built without the GDAL library.

`dolphin.utils` imports it for reading and writing satellite images and switches its exceptions on.
Phase linking, all that dolphin_phase.py calls, never touches it: dolphin's numerical code runs
as it is published.
"""


class Absent:
    """A module of GDAL of which nothing can be used."""

    @staticmethod
    def UseExceptions():
        """All that dolphin calls when it is imported."""


gdal = gdal_array = gdalconst = Absent
