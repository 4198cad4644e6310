"""AUC of 155 labels with 100 rounds of bootstrap, beside scikit-learn's AUC of the same resampled rows."""

import time

import numpy as np
from sklearn.metrics import roc_auc_score

from bench.rows import Figure, Row
from llrp_online.metrics import Score, bootstrap

TARGETS, SENSORS, ROUNDS = 31, 5, 100
#: Of the 100 rounds, the peer is timed on these; its time does not depend on which.
PEER_ROUNDS = 2
#: Cells whose intervals are compared with the peer's, from all rounds.
COMPARED = 2


def predictions(count):
    rng = np.random.default_rng(0)
    labels = (rng.random((count, TARGETS, SENSORS)) < 0.2).astype(np.int8)
    scores = (1 / (1 + np.exp(-labels - rng.standard_normal(labels.shape)))).astype(np.float32)
    return scores, labels


def resamples(count, seed=0):
    """The rows that `bootstrap` draws."""
    rng = np.random.default_rng(seed)
    return [rng.integers(0, count, count) for _ in range(ROUNDS)]


def by_scikit_learn(scores, labels, cells, rounds):
    """(rounds, cells)."""
    found = [[roc_auc_score(labels[drawn, *cell], scores[drawn, *cell]) for cell in cells] for drawn in rounds]
    return np.array(found)


def test_auc_map_with_intervals(record, short):
    count = 1000 if short else 5000
    scores, labels = predictions(count)
    targets, sensors = np.zeros((TARGETS, 3)), list("abcde")
    cells, rounds = list(np.ndindex(TARGETS, SENSORS)), resamples(count)

    low, high = bootstrap(scores, labels, ROUNDS)
    expected = np.percentile(by_scikit_learn(scores, labels, cells[:COMPARED], rounds), [2.5, 97.5], axis=0)
    difference = np.abs(np.stack([low.ravel()[:COMPARED], high.ravel()[:COMPARED]]) - expected).max()
    once = by_scikit_learn(scores, labels, cells, [np.arange(count)])[0]
    difference = max(difference, np.abs(Score.of(scores, labels, targets, sensors).auc.ravel() - once).max())
    assert difference < 1e-7

    ours, peer = [], []
    for _ in range(3 if short else 7):
        start = time.perf_counter()
        by_scikit_learn(scores, labels, cells, rounds[:PEER_ROUNDS])
        peer.append((time.perf_counter() - start) * ROUNDS / PEER_ROUNDS)
        start = time.perf_counter()
        Score.of(scores, labels, targets, sensors, rounds=ROUNDS)
        ours.append(time.perf_counter() - start)
    record(
        Row(
            "AUC map with 100 bootstrap rounds",
            Figure(ours),
            {"scikit-learn": Figure(peer)},
            {"scikit-learn": 300},
            note=f"{len(cells)} labels, {count} frames; largest difference {difference:.1g}; scikit-learn timed on "
            f"{PEER_ROUNDS} of {ROUNDS} rounds, times {ROUNDS // PEER_ROUNDS}; ours gives the pooled AUC as well",
        )
    )
