"""The weights of models that explain a record alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

ROUNDS = 500  # of expectation and maximisation, each of which can only gain


def stacked(blocks: Sequence[np.ndarray]) -> list[float]:
    """Weights with which the mixture of models predicts left-out blocks best.

    max over w of sum_b log sum_k w_k p_kb, w_k >= 0, sum_k w_k = 1, with the log densities log p_kb
    (blocks,) of each model (Yao, Vehtari, Simpson and Gelman, Using Stacking to Average Bayesian
    Predictive Distributions, Bayesian Analysis 13(3), 2018). The sum is concave in w.
    """
    score = np.array(blocks)
    p = np.exp(score - score.max(axis=0))
    w = np.full(len(p), 1.0 / len(p))
    for _ in range(ROUNDS):
        w = np.mean(w[:, None] * p / (w @ p), axis=1)
    return (w / w.sum()).tolist()
