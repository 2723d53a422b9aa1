"""The threads of linear algebra."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blas import one_blas_thread
from lugrectl.model import model_from_dict


def _threads() -> list[int]:
    pools = pytest.importorskip("threadpoolctl").threadpool_info()
    return [pool["num_threads"] for pool in pools if pool["user_api"] == "blas"]


def test_inside_it_is_one_and_afterwards_what_it_was():
    before = _threads()
    with one_blas_thread():
        assert before and set(_threads()) == {1}
    assert _threads() == before


def test_a_diagnosis_takes_one():
    seen = []
    t = np.arange(0.0, 20.0, 0.01)
    w = 5.0 * np.sin(t)
    record = lg.Record(t=t, w=w, u=0.5 * np.sign(w) + 0.05 * np.cos(t))
    model = model_from_dict({"plant": {"J": 0.05}, "friction": {"model": "coulomb"}}, "here")
    lg.identify(record, model, progress=lambda fraction, what: seen.extend(_threads()))
    assert seen and set(seen) == {1}
