"""What a .plan of QGroundControl must look like before it is read: the parts that are read, and nothing of the rest.

Source: QGroundControl's developer guide, "Plan File Format".
"""

from typing import Annotated, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError

# Far beyond any angle, height or time that means something, and small enough to be computed with.
_MOST = 1e7

Number: TypeAlias = Annotated[float, Field(ge=-_MOST, le=_MOST)]
Latitude: TypeAlias = Annotated[float, Field(ge=-90, le=90)]
Longitude: TypeAlias = Annotated[float, Field(ge=-180, le=180)]
# Not strict: JSON has lists where this has tuples.
Place: TypeAlias = Annotated[tuple[Latitude, Longitude], Strict(False)]
Whole: TypeAlias = Annotated[int, Field(ge=0, le=65_535)]


class _Part(BaseModel):
    # Strict: the reader counts on numbers being numbers. NaN has no place in JSON.
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


class SimpleItem(_Part):
    params: list[Number | None] | None = None
    command: Whole | None = None
    frame: Whole | None = None
    doJumpId: Whole = 0  # noqa: N815 - QGroundControl's names


class Transect(_Part):
    Items: list[SimpleItem] | None = None


class Item(SimpleItem):
    type: str | None = None
    complexItemType: str | None = None  # noqa: N815
    TransectStyleComplexItem: Transect = Transect()


class MissionPart(_Part):
    plannedHomePosition: Annotated[list[Number], Field(max_length=3)] | None = None  # noqa: N815
    hoverSpeed: Number | None = None  # noqa: N815
    vehicleType: Whole | None = None  # noqa: N815
    items: list[Item] = []


class Circle(_Part):
    radius: Annotated[float, Field(gt=0, le=_MOST)]
    center: Place


class _Fence(_Part):
    inclusion: bool = True


class CircleFence(_Fence):
    circle: Circle


class PolygonFence(_Fence):
    polygon: list[Place]


class GeoFence(_Part):
    circles: list[CircleFence] = []
    polygons: list[PolygonFence] = []


class RallyPoints(_Part):
    points: list[list[Number]] = []


class PlanShape(_Part):
    mission: MissionPart
    geoFence: GeoFence | None = None  # noqa: N815
    rallyPoints: RallyPoints | None = None  # noqa: N815


def whole_plan(plan: object) -> PlanShape:
    """Raises ValueError: where the first part lies that is not as it must be, and how it is."""
    try:
        return PlanShape.model_validate(plan)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{place}: {first['msg'][:1].lower()}{first['msg'][1:]}") from error
