"""Reading and writing files: recordings and orientations, one format per module.

`read` recognises the format by content and converts to SI units once, here; `write_recording` and `write_orientation`
choose it by the name's suffix. Files from strangers are taken for hostile: nothing in them is run, and the memory
they can claim is limited.
"""

from northdown.io.array_file import read_array, write_array
from northdown.io.reading import read, read_orientation
from northdown.io.source import MAX_BYTES
from northdown.io.writing import write_orientation, write_recording

__all__ = [
    "MAX_BYTES",
    "read",
    "read_array",
    "read_orientation",
    "write_array",
    "write_orientation",
    "write_recording",
]
