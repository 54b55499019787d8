"""NetCDF 3 files (64-bit offsets) of named arrays, which xarray and other tools open as they are."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import InputError
from scipy.io import netcdf_file

MOST = 2**31 - 4  # [bytes] of one variable
_TYPES = {
    "d": "d",
    "b": "b",
    "i": "i",
    "l": "i",
    "q": "i",
    "?": "b",
}  # NumPy's -> NetCDF's; integers have 32 bits there


class Variable(NamedTuple):
    """A named array: its dimensions' names, its values (numbers, truth values or text) and attributes such as units."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, str | NDArray[Any]]


def write_netcdf(path: Path, variables: Mapping[str, Variable], texts: Mapping[str, str]) -> None:
    """Write variables, each of at least one value, and texts that belong to all of them.

    Raises:
        ValueError: an array is larger than the format allows.
        OSError: the file cannot be written.
    """
    for name, variable in variables.items():
        if variable.values.nbytes > MOST:
            size = f"{variable.values.nbytes:,} bytes, more than the {MOST:,} that NetCDF 3 allows"
            raise InputError(f"run: its {name} would take {size}; must have fewer worlds or steps")
    with path.open("wb") as opened, netcdf_file(opened, "w", version=2) as file:
        for name, text in texts.items():
            setattr(file, name, text.encode())
        for name, variable in variables.items():
            _add(file, name, variable)


def _add(file: Any, name: str, variable: Variable) -> None:
    dims, values, attributes = variable.dims, variable.values, dict(variable.attributes)
    if values.dtype.kind == "U":
        values = np.char.encode(values, "utf-8")
        width = values.dtype.itemsize
        values, dims = values.view("S1").reshape(*values.shape, width), (*dims, f"text{width}")
        attributes["_Encoding"] = "utf-8"
    elif values.dtype.kind == "b":
        attributes["dtype"] = "bool"  # as xarray knows them again
    for dim, length in zip(dims, values.shape, strict=True):
        if dim not in file.dimensions:
            file.createDimension(dim, length)
        assert file.dimensions[dim] == length, f"{name}: {length} along {dim}, not {file.dimensions[dim]}"
    added = file.createVariable(name, _TYPES.get(values.dtype.char, "c"), dims)
    added[:] = values
    for key, value in attributes.items():
        setattr(added, key, value.encode() if isinstance(value, str) else value)


def read_netcdf(path: Path, *texts: str) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """The arrays of a file that `write_netcdf` wrote, and these texts of it."""
    with path.open("rb") as opened, netcdf_file(opened, "r", mmap=False) as file:
        arrays = {name: _native(variable) for name, variable in file.variables.items()}
        return arrays, tuple(getattr(file, name).decode() for name in texts)


def _native(variable: Any) -> NDArray[Any]:
    if variable.typecode() == "c":
        return np.char.decode(variable.data.view(f"S{variable.shape[-1]}")[..., 0], "utf-8")
    truth = getattr(variable, "dtype", b"") == b"bool"
    return np.array(variable.data, dtype=bool if truth else variable.data.dtype.newbyteorder("="))
