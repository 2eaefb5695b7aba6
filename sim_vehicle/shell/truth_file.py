"""Truth in a file, so that a simulation in a process of its own can hand it over after a flight."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from sim_vehicle.quantities import Floats
from sim_vehicle.truth import FaultSpan, Hit, TruthRecorder, clock_jumps

_HITS = TypeAdapter(list[Hit])


def save_truth(path: Path, truth: TruthRecorder, epoch_at_boot_us: int, stalls: Sequence[tuple[int, int]] = ()) -> None:
    """Write hits and path as `.npz`; ``epoch_at_boot_us`` is the wall clock at the vehicle's boot time 0, by its end.

    ``stalls``: boot times at which its clock stood, and for how long.
    """
    hits = json.dumps([asdict(hit) for hit in truth.hits_so_far()])
    faults = json.dumps([asdict(fault) for fault in truth.faults])
    arrays: dict[str, Any] = {**truth.series(), "hits": hits, "faults": faults, "epoch_at_boot_us": epoch_at_boot_us}
    arrays["stalls"] = np.array(stalls, dtype=np.int64).reshape(-1, 2)
    unfinished = path.with_name(f"{path.name}.part")
    # Given a path, numpy would put its own ending on it.
    with unfinished.open("wb") as file:
        np.savez_compressed(file, **arrays)
    unfinished.replace(path)


def load_truth(path: Path) -> tuple[list[Hit], dict[str, Floats], int]:
    """Hits, path and the wall clock (microseconds) at the vehicle's boot time 0.

    Raises whatever a file leads to that holds anything else; ValueError for a path without all of its columns.
    """
    with np.load(path) as stored:
        rows, arms = stored["arm_fold_m"].shape
        series = {
            name: np.asarray(stored[name], float).reshape(rows, *like.shape[1:])
            for name, like in TruthRecorder(rotors=arms).series().items()
        }
        return _HITS.validate_json(str(stored["hits"])), series, int(stored["epoch_at_boot_us"])


def load_clock(path: Path) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Boot times at which the vehicle's clock stood, and how long; from which on a fault had it tell later ones."""
    with np.load(path) as stored:
        stalls, faults = stored["stalls"].tolist(), json.loads(str(stored["faults"]))
    return stalls, clock_jumps(FaultSpan(**fault) for fault in faults)
