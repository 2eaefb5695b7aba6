"""Number types for files a person writes: finite, never a string or a truth value in disguise."""

import warnings
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0)]
# A hundred kilometres: no companion's radio, and no flat map, reaches further.
FARTHEST_M = 100_000.0
Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-FARTHEST_M, le=FARTHEST_M)]
PositionNed = tuple[Coordinate, Coordinate, Coordinate]


class StrictModel(BaseModel):
    """Base of everything a person writes: unknown keys are errors, values never change afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)

    retired: ClassVar[frozenset[str]] = frozenset()
    """Keys of earlier versions: files that have them are taken, with a warning."""
    bare: ClassVar[frozenset[str]] = frozenset()
    """Keys that need no value: without one, which YAML reads as null, they are as with an empty map."""

    @model_validator(mode="before")
    @classmethod
    def _as_written(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        for key in sorted(cls.retired.intersection(data)):
            warnings.warn(f"the key {key} has no effect any more: it can be left out", stacklevel=2)
        kept = {key: value for key, value in data.items() if key not in cls.retired}
        return kept | {key: {} for key in cls.bare if kept.get(key, {}) is None}
