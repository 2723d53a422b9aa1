"""Run as a script, since a damaged file may bring the library down: reads a MAT, HDF5 or Parquet
file and writes its arrays to standard output. It imports nothing of the package.
"""

import pickle
import sys

import numpy as np


def mat(path):
    """The variables, and the names of those that only MATLAB can read."""
    from scipy.io import loadmat

    content, hidden = loadmat(path, simplify_cells=True, appendmat=False), []
    for name, value in list(content.items()):
        if type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
            hidden.append(value["s0"].ravel()[0].decode() if value.dtype.names else name)
            del content[name]
    return content, hidden


def hdf(path):
    """The numeric arrays of an HDF5 file, by path with dots."""
    import h5py

    arrays = {}

    def keep(name, item):
        if not isinstance(item, h5py.Dataset) or "#refs#" in name:
            return
        if item.attrs.get("MATLAB_class") in (b"char", "char"):
            return
        if item.dtype.kind in "fiub" or item.dtype.names:
            arrays[name.replace("/", ".")] = np.asarray(item[()])

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return arrays


def parquet(path):
    import pyarrow.parquet as library

    table = library.read_table(path, page_checksum_verification=True)
    found = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        values = column.to_numpy()
        if values.dtype == object:
            values = list(values)
        found[name] = values
    return found


if __name__ == "__main__":
    try:
        answer = True, {"mat": mat, "hdf": hdf, "parquet": parquet}[sys.argv[1]](sys.argv[2])
    except BaseException as error:  # a damaged file raises any kind
        answer = False, " ".join(f"{error}".split())[:200] or type(error).__name__
    sys.stdout.buffer.write(pickle.dumps(answer))
