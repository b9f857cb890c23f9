"""Intervals and tests by scipy and statsmodels: makes tests/fixtures/statistics.json.

    python tests/peers/statistics_peers.py tests/fixtures/statistics.json

Needs numpy, scipy and statsmodels from PyPI.
"""

import json
import pathlib
import sys

import numpy as np
import scipy
import statsmodels
from scipy import stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

SHARES = [(0, 1), (1, 1), (0, 18), (1, 18), (9, 18), (13, 18), (16, 18), (18, 18), (26, 216),
          (188, 216), (216, 216), (1, 10_000), (9_999, 10_000), (4_321, 10_000)]
FOURFOLD = [(0, 0, 0, 0), (0, 18, 0, 18), (18, 18, 18, 18), (18, 18, 0, 18), (18, 18, 15, 18),
            (13, 18, 10, 18), (3, 3, 0, 2), (7, 18, 20, 54), (188, 216, 71, 216), (5, 1000, 14, 900)]
DISCORDANT = [(0, 0), (1, 0), (0, 5), (6, 0), (3, 3), (4, 5), (10, 2), (25, 5), (117, 4), (600, 700), (2000, 1)]
FAMILIES = [[], [0.04], [0.01, 0.04, 0.03, 0.005], [0.5, 0.5, 0.5], [1.0, 0.001, 0.2, 0.001, 0.6],
            [0.0, 0.011, 0.012, 0.03, 0.2, 0.021, 0.7, 0.04, 1.0, 0.5, 0.001, 0.3]]
# Time in a wrong lane and driven, of episodes of one system and another.
FIRST = [(0.0, 95.1), (3.2, 80.4), (0.0, 130.0), (11.8, 60.2), (0.4, 71.0), (0.0, 99.9), (25.0, 41.3), (1.1, 88.0)]
SECOND = [(0.0, 90.0), (0.1, 85.2), (0.0, 128.5), (2.2, 75.0), (0.0, 74.4), (0.3, 97.0), (4.0, 90.1), (0.0, 91.5)]


def fisher(k, n, other_k, m):
    return float(stats.fisher_exact([[k, n - k], [other_k, m - other_k]])[1])


def by_mcnemar(first, second):
    return float(mcnemar([[10, first], [second, 10]], exact=True).pvalue)


def of_ratio(above, below, axis=-1):
    return np.sum(above, axis=axis) / np.sum(below, axis=axis)


def of_difference(above, below, other_above, other_below, axis=-1):
    return of_ratio(above, below, axis) - of_ratio(other_above, other_below, axis)


def resampled(statistic, *columns):
    found = stats.bootstrap(columns, statistic, paired=True, method="percentile", n_resamples=200_000,
                            vectorized=True, batch=10_000, rng=np.random.default_rng(7))
    return [float(found.confidence_interval.low), float(found.confidence_interval.high)]


def main(out):
    first, second = np.array(FIRST).T, np.array(SECOND).T
    fixture = {
        "made_with": {"scipy": scipy.__version__, "statsmodels": statsmodels.__version__},
        "wilson": [[k, n, *map(float, proportion_confint(k, n, method="wilson"))] for k, n in SHARES],
        "fisher": [[*table, fisher(*table)] for table in FOURFOLD],
        "mcnemar": [[*pair, by_mcnemar(*pair)] for pair in DISCORDANT],
        "holm": [[p, [float(q) for q in multipletests(p, method="holm")[1]] if p else []] for p in FAMILIES],
        "bootstrap": {
            "first": FIRST,
            "second": SECOND,
            "ratio": resampled(of_ratio, *first),
            "difference": resampled(of_difference, *first, *second),
        },
    }
    pathlib.Path(out).write_text(json.dumps(fixture, indent=1) + "\n")


main(sys.argv[1])
