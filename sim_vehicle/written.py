"""What a person writes: the models' base, and numbers within limits."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

# No number of a vehicle or its world is larger, in SI units; sums and squares of such numbers stay finite.
LARGEST = 1e6

Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]


# Without words of its own, which a part that has none would show in the reference.
class Part(BaseModel):
    # No unknown keys, no changes.
    model_config = ConfigDict(extra="forbid", frozen=True)
