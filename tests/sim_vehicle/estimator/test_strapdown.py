"""The filter's model: every derivative against small differences, every sign against a case everyone knows."""

import numpy as np
import pytest

from sim_vehicle.estimator.strapdown import (
    ERROR_ROWS,
    NOMINAL_ROWS,
    SAMPLE_COLUMNS,
    advance,
    correct,
    down_range,
    heading,
    predict_now,
)

STEP_S = 0.004
NOISE = np.array([1e-5, 1e-3, 1e-6, 1e-6, 0.1])


def tilted() -> np.ndarray:
    """Some state in flight, none of whose entries is special."""
    place, velocity, biases = [1.0, -2.0, -1.7], [1.5, -0.7, 0.3], [0.002, -0.001, 0.003, 0.05, -0.03, 0.02]
    attitude = np.array([0.95, 0.12, -0.17, 0.21])
    return np.concatenate([place, velocity, attitude / np.linalg.norm(attitude), biases, [0.01, -0.02]])


def some_sample() -> np.ndarray:
    sample = np.zeros(SAMPLE_COLUMNS)
    sample[0:6] = [1.2, -0.8, -11.0, 0.6, -0.9, 0.4]
    return sample


def advanced(nominal: np.ndarray, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    after, f, q = nominal.copy(), np.eye(ERROR_ROWS), np.zeros((ERROR_ROWS, ERROR_ROWS))
    advance(after, sample, STEP_S, NOISE, f, q)
    return after, f, q


def erred(nominal: np.ndarray, row: int, size: float) -> np.ndarray:
    """The state that is ``size`` of one error away."""
    error = np.zeros(ERROR_ROWS)
    error[row] = size
    moved = nominal.copy()
    correct(moved, error)
    return moved


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The error that leads from ``b`` to ``a``."""
    conjugate = b[6:10] * [1, -1, -1, -1]
    w, x, y, z = conjugate
    p, q, r, s = a[6:10]
    turn = 2 * np.array([w * q + x * p + y * s - z * r, w * r - x * s + y * p + z * q, w * s + x * r - y * q + z * p])
    return np.concatenate([turn, a[3:6] - b[3:6], a[0:3] - b[0:3], a[10:] - b[10:]])


@pytest.mark.parametrize("row", range(ERROR_ROWS))
def test_the_transition_is_the_derivative_of_the_motion(row: int) -> None:
    size = 1e-5
    plus, minus = (advanced(erred(tilted(), row, sign * size), some_sample())[0] for sign in (1, -1))
    _, f, _ = advanced(tilted(), some_sample())
    # F is of first order in the step of 4 ms: what it leaves out is of second order.
    assert difference(plus, minus) / (2 * size) == pytest.approx(f[:, row], abs=2e-4)


@pytest.mark.parametrize("measure", [down_range, heading])
def test_each_measurements_row_is_its_derivative(measure) -> None:
    row, unused = np.empty(ERROR_ROWS), np.empty(ERROR_ROWS)
    measure(tilted(), row)
    for column in range(ERROR_ROWS):
        plus, minus = (measure(erred(tilted(), column, sign * 1e-6), unused) for sign in (1, -1))
        assert (plus - minus) / 2e-6 == pytest.approx(row[column], abs=1e-6)


def test_the_output_predictor_brings_the_state_through_the_samples_not_used_yet() -> None:
    # Given a filter three samples behind, and a ring in which the oldest row is the one it used last
    samples = np.tile(some_sample(), (4, 1))
    samples[:, 0] = [0.5, 1.0, 1.5, 2.0]
    now, expected = np.empty(NOMINAL_ROWS + 3), tilted()
    # When its state is carried to now
    predict_now(tilted(), samples, 1, STEP_S, now)
    # Then it is where the filter will be once it has used them, in order
    for row in (2, 3, 0):
        expected, _, _ = advanced(expected, samples[row])
    assert now[:10] == pytest.approx(expected[:10], abs=1e-12)
