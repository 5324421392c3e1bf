"""A MATLAB .mat file (version 7 and older) → columns by the names of its variables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.io import loadmat

from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.columns import Column


def read_mat_columns(path: Path | str, columns: dict[str, Column]) -> dict[str, npt.NDArray[np.float64]]:
    """Read some variables of a .mat file, each a row or a column of numbers.

    Parameters
    ----------
    path : the file. columns : what to read, by the key of the result; a column's name is the variable's.

    Returns
    -------
    key → (n,) values in SI units.

    Raises
    ------
    ShakeError : the file cannot be read, a variable is not there, is no vector of numbers, or lengths differ.
    """
    try:
        content = loadmat(str(path), appendmat=False)
    except OSError as error:
        raise ShakeError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # loadmat lets any error of a damaged file through
        if "v7.3" in str(error):
            raise ShakeError(f"{path}: is a .mat file of version 7.3 (HDF5); save it with -v7") from None
        raise ShakeError(f"{path}: is not a readable .mat file ({str(error)[:120]})") from None
    names = [name for name in content if not name.startswith("__")]
    values = {}
    for key, column in columns.items():
        if column.name not in names:
            raise unknown_name("variable", column.name, names, str(path))
        array = np.asarray(content[column.name])
        if array.dtype.kind not in "fiub" or array.size != max(array.shape, default=0) or array.size < 2:
            raise ShakeError(f"{path}: variable '{column.name}' of shape {array.shape} is no column of real numbers")
        values[key] = array.ravel().astype(np.float64) * column.scale + column.offset
    lengths = {columns[key].name: len(x) for key, x in values.items()}
    if len(set(lengths.values())) > 1:
        raise ShakeError(f"{path}: variables differ in length: {', '.join(f'{n} {k}' for n, k in lengths.items())}")
    return values
