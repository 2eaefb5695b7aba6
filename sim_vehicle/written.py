"""What a person writes: the models' base, and numbers within limits."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


# Without words of its own, which a part that has none would show in the reference.
class Part(BaseModel):
    # No unknown keys, no changes.
    model_config = ConfigDict(extra="forbid", frozen=True)
