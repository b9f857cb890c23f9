"""Answers of scipy and scikit-learn for tests/it/statistics.rs.

    pip install scipy==1.17.1 scikit-learn==1.9.1
    python tests/peers/offline_metrics.py > tests/fixtures/offline_metrics.json
"""

import json

import numpy as np
from scipy import integrate, optimize, stats
from sklearn.metrics import precision_recall_fscore_support, roc_auc_score

random = np.random.default_rng(7)


def number(x):
    return float(x)


def mixture(parts):
    weights = random.dirichlet(np.ones(parts))
    means = random.normal(0, 3, parts)
    stds = random.uniform(0.05, 2, parts)
    x = random.normal(0, 3)

    def cdf(at):
        return sum(w * stats.norm.cdf(at, m, s) for w, m, s in zip(weights, means, stds))

    def quantile(share):
        return optimize.brentq(lambda at: cdf(at) - share, -60, 60, xtol=1e-13)

    breaks = sorted([*means, x])
    low, high = min(breaks) - 30, max(breaks) + 30
    pieces = [low, *breaks, high]
    crps = sum(
        integrate.quad(lambda at: (cdf(at) - (at >= x)) ** 2, a, b, epsabs=1e-12, limit=200)[0]
        for a, b in zip(pieces, pieces[1:])
    )
    return {
        "weights": list(map(number, weights)),
        "means": list(map(number, means)),
        "stds": list(map(number, stds)),
        "x": number(x),
        "cdf": number(cdf(x)),
        "crps": number(crps),
        "quantiles": [[share, number(quantile(share))] for share in (0.025, 0.1, 0.25, 0.5, 0.75, 0.9, 0.975)],
    }


def ranked(size, ties):
    a = random.normal(0, 1, size)
    b = a + random.normal(0, 2, size)
    if ties:
        a, b = np.round(a), np.round(b)
    case = b > np.quantile(b, 0.9)
    return {
        "pairs": [[number(x), number(y)] for x, y in zip(a, b)],
        "ranks": list(map(number, stats.rankdata(a))),
        "spearman": number(stats.spearmanr(a, b).statistic),
        "quantile_90": number(np.quantile(b, 0.9)),
        "auroc": number(roc_auc_score(case, a)),
    }


def uniforms(size):
    values = random.beta(2, 1.5, size)
    # Numbers as the grid sees them: in the middles of hundredths.
    values = (np.floor(values * 100) + 0.5) / 100
    levels = np.arange(1, 20) / 20
    shares = np.array([np.mean(values <= level) for level in levels])
    fine = np.arange(1, 100) / 100
    return {
        "values": list(map(number, values)),
        "ece": number(np.mean(np.abs(shares - levels))),
        "ks_on_grid": number(max(abs(np.mean(values <= level) - level) for level in fine)),
        "ks": number(stats.kstest(values, "uniform").statistic),
    }


def steering(size, window, timestep):
    """The definitions of Codevilla et al., 2018, in numpy."""
    recorded = np.round(random.normal(0, 0.2, size), 3)
    planned = np.round(recorded + random.normal(0, 0.05, size), 3)
    speed = np.round(random.uniform(-1, 12, size), 3)
    brakes = np.round(random.uniform(0, 0.3, size), 3)
    braking = np.round(np.clip(brakes + random.normal(0, 0.1, size), 0, 1), 3)
    off = planned - recorded
    way = off * np.abs(speed) * timestep
    sums = np.lib.stride_tricks.sliding_window_view(way, window).sum(axis=1)
    classes = [np.digitize(side, [-0.03, 0.03]) for side in (planned, recorded)]
    precision, recall, f1, _ = precision_recall_fscore_support(brakes > 0.1, braking > 0.1, average="binary")
    return {
        "recorded": list(map(number, recorded)),
        "planned": list(map(number, planned)),
        "speed_mps": list(map(number, speed)),
        "recorded_brake": list(map(number, brakes)),
        "planned_brake": list(map(number, braking)),
        "steer_l1": number(np.mean(np.abs(off))),
        "steer_speed_weighted": number(np.mean(np.abs(off) * np.abs(speed))),
        "steer_cumulative": number(np.mean(np.abs(sums))),
        "steer_class_error": number(np.mean(classes[0] != classes[1])),
        "steer_relative_error": number(np.mean(np.abs(off) > 0.1 * np.abs(recorded))),
        "brake_precision": number(precision),
        "brake_recall": number(recall),
        "brake_f1": number(f1),
    }


answers = {
    "mixtures": [mixture(parts) for parts in (1, 1, 2, 2, 3, 3, 6)],
    "ranked": [ranked(200, False), ranked(200, True)],
    "uniforms": uniforms(500),
    "steering": steering(120, 16, 0.1),
}
print(json.dumps(answers))
