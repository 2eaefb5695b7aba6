"""What a person writes: the models' base, and numbers within limits."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

# No number of a vehicle or its world is larger, in SI units; sums and squares of such numbers stay finite.
LARGEST = 1e9


def _possible(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"no such number has a size above {LARGEST:,.0f}")
    return value


_Possible = AfterValidator(_possible)
Finite = Annotated[float, Field(allow_inf_nan=False), _Possible]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False), _Possible]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False), _Possible]


# Without words of its own, which a part that has none would show in the reference.
class Part(BaseModel):
    # No unknown keys, no changes.
    model_config = ConfigDict(extra="forbid", frozen=True)
