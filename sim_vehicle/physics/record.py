"""Records: one block of memory that a kernel gets by reference, described by a class of annotations.

Passing numba a tuple of arrays makes every call copy and count each of them; a record is one pointer.
"""

from functools import cache
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from sim_vehicle.quantities import Floats

Vector3 = Annotated[Floats, (3,)]
Vector4 = Annotated[Floats, (4,)]
Matrix3 = Annotated[Floats, (3, 3)]

RecordType = TypeVar("RecordType")


def new_record(kind: type[RecordType], **values: Any) -> RecordType:
    """A record with the fields that ``kind`` annotates, zero but for ``values``.

    `int` and `float` fields are 64 bits wide; an array field is `Annotated[..., shape]`, of integers if
    the annotation ends in `int`. Raises ValueError for a value that is no field.
    """
    record = np.zeros(1, _layout(cast(Any, kind))).view(np.recarray)[0]
    for name, value in values.items():
        record[name] = value
    return cast(RecordType, record)


def boxed(record: Any) -> npt.NDArray[Any]:
    """The same memory as an array of one: handing numba a record costs 1 to 3 us, the array a tenth of that."""
    return np.asarray(record.base).view(np.ndarray)


@cache
def _layout(kind: Any) -> np.dtype[Any]:
    fields = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if get_origin(hint) is Annotated:
            shape, *rest = get_args(hint)[1:]
            fields.append((name, np.int64 if int in rest else np.float64, shape))
        else:
            fields.append((name, np.int64 if hint is int else np.float64, ()))
    # A record already: else `view` makes a dtype for each, which numba compares with the first one's, field by field.
    return np.dtype((np.record, np.dtype(fields, align=True)))
