//! Whether one system drives better than another: on the same episodes where both drove them.

use crate::{
    closed_loop::row::EpisodeRow,
    eval::{
        statistics::{
            Bootstrap, FEWEST_UNITS,
            paired::{holm, mcnemar_exact},
            proportion::fisher_exact,
            ratio::{Term, ratio},
        },
        table::{
            definitions::{Better, COMPARED, Metric, metric},
            episodes::Driven,
            report::{Comparison, Difference, SuccessTest, System, Task, Test, Verdict},
        },
    },
};

/// Claims are made below it.
const SIGNIFICANT: f64 = 0.05;

/// Every pair of what was driven.
pub fn of_driven(systems: &[Driven], tasks: &[Task], bootstrap: Bootstrap) -> Vec<Comparison> {
    let pairs = pairs(systems).map(|(first, second)| {
        let alone = first.policies.len() == 1 && second.policies.len() == 1;
        let test = |task: Option<&Task>| alone.then(|| success(first, second, task)).flatten();
        Comparison {
            first: first.name.clone(),
            second: second.name.clone(),
            tasks: tasks.iter().map(|task| test(Some(task))).collect(),
            pooled: test(None),
            differences: differences(first, second, alone, bootstrap),
            verdict: Verdict::TooFew,
            sentence: String::new(),
        }
    });
    let names = systems.iter().map(|system| format!("`{}`", system.name)).collect();
    concluded(pairs.collect(), names, tasks)
}

/// Every pair of what was printed: of which episodes were won by both nothing is known.
pub fn of_printed(systems: &[System], tasks: &[Task]) -> Vec<Comparison> {
    let test = |first: &System, second: &System, task: Option<usize>| {
        let counts = |system: &System| {
            let cell = task.map_or(&system.pooled, |i| &system.tasks[i]);
            cell.of("sr").k.map(|k| [k, cell.of("sr").n])
        };
        Some(unpaired(counts(first)?, counts(second)?))
    };
    let pairs = pairs(systems).map(|(first, second)| Comparison {
        first: first.name.clone(),
        second: second.name.clone(),
        tasks: (0..tasks.len()).map(|task| test(first, second, Some(task))).collect(),
        pooled: test(first, second, None),
        differences: Vec::new(),
        verdict: Verdict::TooFew,
        sentence: String::new(),
    });
    concluded(pairs.collect(), systems.iter().map(|system| system.shown()).collect(), tasks)
}

fn pairs<T>(systems: &[T]) -> impl Iterator<Item = (&T, &T)> {
    let with_later = |(i, first)| systems[i + 1..].iter().map(move |second| (first, second));
    systems.iter().enumerate().flat_map(with_later)
}

/// Success of two policies in a task, or in all.
fn success(first: &Driven, second: &Driven, task: Option<&Task>) -> Option<SuccessTest> {
    let within = |row: &EpisodeRow| {
        task.is_none_or(|task| row.town == task.town && row.traffic == task.traffic)
    };
    let outcomes = |system: &Driven| -> Vec<(_, bool)> {
        let ended = system.ended().into_iter().filter(|(_, rows)| within(rows[0]));
        ended
            .map(|(key, rows)| {
                ((key.0.to_string(), key.1.to_string(), key.2, key.3), rows[0].success)
            })
            .collect()
    };
    let (all_first, all_second) = (outcomes(first), outcomes(second));
    if all_first.is_empty() || all_second.is_empty() {
        return None;
    }
    let of_second = |key| {
        all_second.binary_search_by(|(other, _)| other.cmp(key)).ok().map(|i| all_second[i].1)
    };
    let both: Vec<(bool, bool)> =
        all_first.iter().filter_map(|(key, won)| Some((*won, of_second(key)?))).collect();
    if both.is_empty() {
        let counts = |outcomes: &[(_, bool)]| {
            [outcomes.iter().filter(|(_, won)| *won).count() as u64, outcomes.len() as u64]
        };
        return Some(unpaired(counts(&all_first), counts(&all_second)));
    }
    let count = |is: fn(bool, bool) -> bool| both.iter().filter(|(a, b)| is(*a, *b)).count() as u64;
    let (only_first, only_second) = (count(|a, b| a && !b), count(|a, b| b && !a));
    let n = both.len() as u64;
    let p = mcnemar_exact(only_first, only_second);
    Some(SuccessTest {
        test: Test::Mcnemar,
        first: [count(|a, _| a), n],
        second: [count(|_, b| b), n],
        only_first: Some(only_first),
        only_second: Some(only_second),
        p,
        p_holm: p,
    })
}

fn unpaired(first: [u64; 2], second: [u64; 2]) -> SuccessTest {
    let p = fisher_exact(first, second);
    let test = Test::Fisher;
    SuccessTest { test, first, second, only_first: None, only_second: None, p, p_holm: p }
}

/// [`COMPARED`] over the episodes that both drove; several seeds of one add up in each episode.
fn differences(
    first: &Driven,
    second: &Driven,
    alone: bool,
    bootstrap: Bootstrap,
) -> Vec<Difference> {
    let known = COMPARED.iter().filter(|key| !alone || **key != "sr");
    let metrics: Vec<&Metric> = known.filter_map(|key| metric(key)).collect();
    let of_second = second.ended();
    let both = first.ended();
    let both: Vec<_> =
        both.iter().filter_map(|(key, rows)| Some((rows, of_second.get(key)?))).collect();
    let terms = |rows: &[&EpisodeRow]| metrics.iter().map(|m| summed(m, rows)).collect::<Vec<_>>();
    let units: Vec<Vec<Term>> = both.iter().map(|(a, b)| [terms(a), terms(b)].concat()).collect();
    let value = |i: usize| ratio(units.iter().map(|unit| unit[i]));
    let values: Vec<_> = (0..metrics.len()).map(|i| [value(i), value(metrics.len() + i)]).collect();
    let intervals = bootstrap.ratio_differences(units.clone());
    let episodes = units.len();
    let of_metric = |((metric, [first, second]), interval): ((&&Metric, [Option<f64>; 2]), _)| {
        let scaled = |value: f64| value * metric.measure.scale();
        let interval = Option::map(interval, |ends: [f64; 2]| ends.map(scaled));
        Difference {
            metric: metric.key.to_string(),
            episodes: episodes as u64,
            first: first.map(scaled),
            second: second.map(scaled),
            difference: first.zip(second).map(|(a, b)| scaled(a - b)),
            interval,
            verdict: verdict(metric.better, interval, episodes),
        }
    };
    metrics.iter().zip(values).zip(intervals).map(of_metric).collect()
}

fn summed(metric: &Metric, rows: &[&EpisodeRow]) -> Term {
    let add = |sum: [f64; 2], term: [f64; 2]| [sum[0] + term[0], sum[1] + term[1]];
    rows.iter().filter_map(|row| metric.measure.term(row)).reduce(add)
}

fn verdict(better: Better, interval: Option<[f64; 2]>, episodes: usize) -> Verdict {
    if episodes < FEWEST_UNITS {
        return Verdict::TooFew;
    }
    let Some([low, high]) = interval else { return Verdict::NoDifference };
    match better {
        Better::Higher if low > 0.0 => Verdict::FirstIsBetter,
        Better::Higher if high < 0.0 => Verdict::SecondIsBetter,
        Better::Lower if high < 0.0 => Verdict::FirstIsBetter,
        Better::Lower if low > 0.0 => Verdict::SecondIsBetter,
        _ => Verdict::NoDifference,
    }
}

/// Holm's correction over the tasks of each pair and over the pairs, then verdicts.
fn concluded(
    mut comparisons: Vec<Comparison>,
    names: Vec<String>,
    tasks: &[Task],
) -> Vec<Comparison> {
    for comparison in &mut comparisons {
        correct(comparison.tasks.iter_mut().flatten().collect());
    }
    correct(comparisons.iter_mut().filter_map(|comparison| comparison.pooled.as_mut()).collect());
    let pooled = comparisons.iter().filter(|comparison| comparison.pooled.is_some()).count();
    for (comparison, (first, second)) in comparisons.iter_mut().zip(pairs(&names)) {
        (comparison.verdict, comparison.sentence) = match &comparison.pooled {
            Some(test) => {
                let verdict = of_test(test);
                (verdict, sentence(test, verdict, [first, second], pooled, comparison, tasks))
            }
            None => of_difference(comparison, [first, second]),
        };
    }
    comparisons
}

fn correct(mut tests: Vec<&mut SuccessTest>) {
    let p: Vec<f64> = tests.iter().map(|test| test.p).collect();
    tests.iter_mut().zip(holm(&p)).for_each(|(test, p)| test.p_holm = p);
}

/// What one corrected test allows to say.
pub fn of_test(test: &SuccessTest) -> Verdict {
    let [[k, n], [other, m]] = [test.first, test.second];
    if n.min(m) < FEWEST_UNITS as u64 {
        Verdict::TooFew
    } else if test.p_holm >= SIGNIFICANT {
        Verdict::NoDifference
    } else if k * m > other * n {
        Verdict::FirstIsBetter
    } else {
        Verdict::SecondIsBetter
    }
}

/// `first` and `second` in the order of the verdict, and what it says of them.
fn claim(verdict: Verdict, [first, second]: [&String; 2]) -> String {
    match verdict {
        Verdict::FirstIsBetter => format!("{first} succeeds more often than {second}"),
        Verdict::SecondIsBetter => format!("{second} succeeds more often than {first}"),
        Verdict::NoDifference => {
            format!("no difference in success can be claimed between {first} and {second}")
        }
        Verdict::TooFew => format!(
            "no difference in success can be claimed between {first} and {second}, too few \
             episodes for a claim"
        ),
    }
}

fn sentence(
    test: &SuccessTest,
    verdict: Verdict,
    names: [&String; 2],
    pairs: usize,
    comparison: &Comparison,
    tasks: &[Task],
) -> String {
    let [first, second] = names;
    let claim = claim(verdict, names);
    // The better one's numbers first, as the claim names them.
    let (mut counts, mut who) = ([test.first, test.second], [first, second]);
    let mut alone = [test.only_first, test.only_second];
    if verdict == Verdict::SecondIsBetter {
        counts.reverse();
        who.reverse();
        alone.reverse();
    }
    let [[k, n], [other, m]] = counts;
    let same = match alone {
        [Some(a), Some(b)] => {
            format!("of the same episodes, {a} won by {} alone and {b} by {} alone", who[0], who[1])
        }
        _ => "of unpaired episodes".to_string(),
    };
    let over_pairs = match pairs {
        0 | 1 => String::new(),
        _ => format!(", after Holm over {pairs} pairs p {}", p_text(test.p_holm)),
    };
    let tested = comparison.tasks.iter().flatten().count();
    let decided: Vec<String> = comparison
        .tasks
        .iter()
        .zip(tasks)
        .filter(|(test, _)| test.as_ref().is_some_and(|test| test.p_holm < SIGNIFICANT))
        .map(|(_, task)| format!("{} {}", task.town, task.traffic))
        .collect();
    let on_tasks = match (tested, decided.is_empty()) {
        (0 | 1, _) => String::new(),
        (_, true) => format!("; after Holm over {tested} tasks they differ in none"),
        (_, false) if decided.len() == tested => {
            format!("; after Holm over {tested} tasks they differ in all")
        }
        (_, false) => {
            format!("; after Holm over {tested} tasks they differ in {}", decided.join(", "))
        }
    };
    format!(
        "{claim}: {k}/{n} against {other}/{m} {same} (exact {} p {}{over_pairs}){on_tasks}",
        test.test.text(),
        p_text(test.p),
    )
}

/// Of several seeds: the difference of success rates over episodes says it.
fn of_difference(comparison: &Comparison, names: [&String; 2]) -> (Verdict, String) {
    let Some(sr) = comparison.differences.iter().find(|d| d.metric == "sr") else {
        return (Verdict::TooFew, claim(Verdict::TooFew, names));
    };
    let rate = |value: Option<f64>| value.map_or("--".to_string(), |value| format!("{value:.1} %"));
    let interval = sr.interval.map_or("no interval".to_string(), |[low, high]| {
        format!("95 % interval of the difference {low:.1} ... {high:.1}")
    });
    let sentence = format!(
        "{}: {} for {} against {} for {} over {} episodes that both drove ({interval}, of these seeds)",
        claim(sr.verdict, names),
        rate(sr.first),
        names[0],
        rate(sr.second),
        names[1],
        sr.episodes,
    );
    (sr.verdict, sentence)
}

/// A p-value as it is written: `= 0.0123` or `< 0.0001`.
pub fn p_text(p: f64) -> String {
    if p < 0.0001 { "< 0.0001".to_string() } else { format!("= {p:.4}") }
}
