//! Driven episodes: kept, and made into tables.

use std::{fs, path::Path};

use arrow::{
    array::{ArrayRef, RecordBatch, StringArray},
    datatypes::{Field, Schema},
};
use parquet::arrow::{ArrowWriter, arrow_reader::ParquetRecordBatchReaderBuilder};
use pmp::{
    closed_loop::{results, row::EpisodeRow},
    error::Error,
    eval::{
        statistics::{Bootstrap, paired::mcnemar_exact, proportion::fisher_exact},
        table::{
            self, csv,
            definitions::METRICS,
            episodes::{self, Group},
            latex, markdown,
            paper::{Paper, successes},
            report::{Cell, Estimate, System, Table, Task, Test, Touched, Verdict},
            summary,
        },
    },
};

/// An episode of 100 s and 500 m that reached its goal.
fn row(policy: &str, town: &str, traffic: &str, episode: u32) -> EpisodeRow {
    let condition = match town {
        "Town03" => "training conditions",
        "Town05" => "new weather",
        "Town07" => "new town",
        _ => "new town & weather",
    };
    EpisodeRow {
        policy: policy.into(),
        suite: "deeptest".into(),
        condition: condition.into(),
        town: town.into(),
        traffic: traffic.into(),
        weather: "clear".into(),
        illumination: "daytime".into(),
        episode,
        seed: u64::MAX,
        route_m: 500.0,
        progress_m: 496.0,
        driven_m: 500.0,
        duration_s: 100.0,
        time_limit_s: 200.0,
        goal_m: 4.0,
        success: true,
        reason: "goal".into(),
        ..EpisodeRow::default()
    }
}

fn kept(rows: &[EpisodeRow]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(results::FILE);
    results::write(&path, rows).unwrap();
    (folder, path)
}

#[test]
fn episodes_come_back_sorted_and_exact_and_in_the_same_bytes_whatever_their_order() {
    let mut rows = vec![
        row("b", "Town03", "empty", 0),
        row("a", "Town05", "empty", 1),
        row("a", "Town05", "empty", 0),
        row("a", "Town05", "dense", 11),
        row("a", "Town03", "regular", 2),
    ];
    rows[1].least_ttc_s = Some(0.1 + 0.2);
    rows[1].error = Some("a \"quote\", and ünïcode".into());
    rows[2].at_fault = Some(false);
    rows[3].wrong_lane_s = f64::MIN_POSITIVE;
    rows[4].fused = u64::MAX;
    let (_folder, path) = kept(&rows);
    let bytes = fs::read(&path).unwrap();
    let sorted = [4, 3, 2, 1, 0].map(|i| rows[i].clone());
    assert_eq!(results::read(&path).unwrap(), sorted);
    rows.swap(0, 3);
    let (_folder, again) = kept(&rows);
    assert_eq!(fs::read(again).unwrap(), bytes);
}

#[test]
fn a_number_that_is_none_is_not_kept_as_one() {
    let mut rows = vec![row("a", "Town03", "empty", 7)];
    rows[0].wrong_lane_s = f64::NAN;
    let folder = tempfile::tempdir().unwrap();
    let error = results::write(&folder.path().join(results::FILE), &rows).unwrap_err();
    assert!(error.to_string().contains("`wrong_lane_s` of a's Town03 empty 7"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// The same file with its columns, or their metadata, changed.
fn spoilt(path: &Path, change: impl Fn(&mut Vec<(Field, ArrayRef)>), with_version: bool) {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap()).unwrap();
    let metadata = reader.schema().metadata().clone();
    let batch = reader.build().unwrap().next().unwrap().unwrap();
    let fields = batch.schema().fields().clone();
    let mut columns: Vec<(Field, ArrayRef)> =
        fields.iter().map(|f| f.as_ref().clone()).zip(batch.columns().iter().cloned()).collect();
    change(&mut columns);
    let (fields, columns): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
    let metadata = if with_version { metadata } else { Default::default() };
    let schema = std::sync::Arc::new(Schema::new_with_metadata(fields, metadata));
    let batch = RecordBatch::try_new(schema.clone(), columns).unwrap();
    let mut writer = ArrowWriter::try_new(fs::File::create(path).unwrap(), schema, None).unwrap();
    if with_version {
        let version = pmp_version();
        writer.append_key_value_metadata(version);
    }
    writer.write(&batch).unwrap();
    writer.close().unwrap();
}

fn pmp_version() -> parquet::file::metadata::KeyValue {
    parquet::file::metadata::KeyValue::new(results::VERSION_KEY.to_string(), "1".to_string())
}

/// What is said, and what to do about it.
#[track_caller]
fn refusal(path: &Path) -> (String, String) {
    let error = results::read(path).unwrap_err();
    assert!(matches!(error, Error::Report { .. }), "{error:?}");
    assert!(error.to_string().contains("episodes.parquet"), "{error}");
    (error.to_string(), error.hint().unwrap())
}

#[test]
fn a_file_with_other_columns_is_refused_by_the_name_of_the_column() {
    let rows = [row("a", "Town03", "empty", 0)];
    let (_folder, path) = kept(&rows);
    spoilt(&path, |columns| columns.retain(|(field, _)| field.name() != "overspeed_s"), true);
    let (what, hint) = refusal(&path);
    assert!(what.contains("no column `overspeed_s`"), "{what}");
    assert!(hint.contains("pmp-eval drive"), "{hint}");

    let (_folder, path) = kept(&rows);
    let text = |columns: &mut Vec<(Field, ArrayRef)>| {
        let i = columns.iter().position(|(field, _)| field.name() == "seed").unwrap();
        columns[i].0 = Field::new("seed", arrow::datatypes::DataType::Utf8, false);
        columns[i].1 = std::sync::Arc::new(StringArray::from(vec!["7"]));
    };
    spoilt(&path, text, true);
    assert!(refusal(&path).0.contains("column `seed` holds Utf8, not UInt64"));

    let (_folder, path) = kept(&rows);
    spoilt(&path, |_| (), false);
    let (what, hint) = refusal(&path);
    assert!(what.contains("no driven episodes"), "{what}");
    assert!(hint.contains("a dataset's"), "{hint}");

    // Order is nothing, and a column that a later version adds is left alone.
    let (_folder, path) = kept(&rows);
    let more = |columns: &mut Vec<(Field, ArrayRef)>| {
        let mut added = columns[0].clone();
        added.0 = added.0.with_name("new");
        columns.insert(0, added);
        columns.reverse();
    };
    spoilt(&path, more, true);
    assert_eq!(results::read(&path).unwrap(), rows);
}

/// How an episode of a policy ended.
fn failed(mut row: EpisodeRow, reason: &str) -> EpisodeRow {
    row.success = false;
    row.reason = reason.into();
    row.progress_m = 250.0;
    row.driven_m = 250.0;
    row.duration_s = 50.0;
    row.goal_m = 250.0;
    if let Some(what) = reason.strip_prefix("collision-") {
        row.touched = Some(if what == "vehicle" { "van" } else { what }.into());
        row.at_fault = Some(what != "vehicle");
        row.impact_mps = Some(4.0);
    }
    row
}

/// Two policies over six tasks of six episodes: `good` fails the first of each dense task, `poor` all
/// but the first of each.
pub(crate) fn driven() -> Vec<EpisodeRow> {
    let mut rows = Vec::new();
    for town in ["Town07", "Town03"] {
        for traffic in ["dense", "empty", "regular"] {
            for episode in 0..6 {
                let mut good = row("good", town, traffic, episode);
                good.fused = 10;
                good.lambda_sum = if town == "Town03" { 5.0 } else { 2.0 };
                good.variance_sum = 0.5;
                if traffic == "dense" && episode == 0 {
                    good = failed(good, "collision-pedestrian");
                }
                rows.push(good);
                let mut poor = row("poor", town, traffic, episode);
                poor.wrong_lane_s = 10.0;
                poor.overspeed_s = 5.0;
                if episode > 0 {
                    poor = failed(poor, if episode < 4 { "collision-vehicle" } else { "timeout" });
                    poor.overspeed_s = 10.0;
                    poor.goal_m = if episode == 5 { 10.0 } else { 250.0 };
                }
                rows.push(poor);
            }
        }
    }
    rows
}

fn quick() -> Bootstrap {
    Bootstrap { resamples: 200, ..Bootstrap::default() }
}

fn table_of(rows: &[EpisodeRow]) -> Table {
    let rows = episodes::merge(vec![("episodes.parquet".into(), rows.to_vec())]).unwrap();
    summary::of_episodes(&rows, &[], quick(), None).unwrap()
}

fn system<'t>(table: &'t Table, name: &str) -> &'t System {
    table.systems.iter().find(|system| system.name == name).unwrap()
}

#[track_caller]
fn value(cell: &Cell, key: &str) -> f64 {
    cell.of(key).value.unwrap_or_else(|| panic!("{key} has no value"))
}

#[track_caller]
fn near(ours: f64, expected: f64) {
    assert!((ours - expected).abs() < 1e-9, "{ours}, expected {expected}");
}

#[test]
fn sums_are_divided_by_sums_and_means_are_of_episodes() {
    let table = table_of(&driven());
    let poor = system(&table, "poor");
    // Each task: one success of 100 s, five failures of 50 s.
    let cell = &poor.tasks[0];
    assert_eq!((cell.episodes, cell.of("sr").k, cell.of("sr").n), (6, Some(1), 6));
    near(value(cell, "sr"), 100.0 / 6.0);
    near(value(cell, "wl"), 100.0 * 60.0 / 350.0);
    near(value(cell, "wl_mean"), (10.0 + 5.0 * 20.0) / 6.0);
    near(value(cell, "ovsp"), 100.0 * 55.0 / 350.0);
    near(value(cell, "ovsp_mean"), (5.0 + 5.0 * 20.0) / 6.0);
    near(value(cell, "ovsp_success"), 5.0);
    near(value(cell, "ovsp_success_mean"), 5.0);
    assert_eq!(cell.of("ovsp_success").n, 1);
    near(value(cell, "route_completion"), (100.0 + 5.0 * 50.0) / 6.0);
    // Three hit a vehicle (0.6), two ran out of time.
    near(value(cell, "driving_score"), (100.0 + 3.0 * 50.0 * 0.6 + 2.0 * 50.0) / 6.0);
    near(value(cell, "infractions_per_km"), 3.0 / 1.75);
    near(value(cell, "km_between_failures"), 1.75 / 5.0);
    near(value(cell, "contact_vehicle"), 50.0);
    // 10 m from the goal is just before it, and no timeout.
    assert_eq!((cell.of("timeout").k, cell.of("stopped_before_goal").k), (Some(1), Some(1)));
    assert_eq!((cell.of("at_fault").k, cell.of("at_fault").n), (Some(0), 3));
    near(value(cell, "impact"), 4.0);
    near(value(cell, "least_ttc"), 3.0);
    near(value(cell, "speed"), 3.6 * 1750.0 / 350.0);
    assert_eq!(cell.of("lambda").value, None);
    assert_eq!(poor.touched["van"], Touched { contacts: 18, at_fault: 0 });

    let good = system(&table, "good");
    near(value(&good.conditions["training conditions"], "lambda"), 0.5);
    near(value(&good.conditions["new town"], "lambda"), 0.2);
    near(value(&good.pooled, "lambda"), 0.35);
    near(value(&good.pooled, "km_between_failures"), 17.5 / 2.0);
    assert_eq!(good.tasks[0].of("km_between_failures").value, None, "no failure");
    assert_eq!(good.pooled.of("at_fault").k, Some(2));
    assert!(table.caveats.is_empty());
}

#[test]
fn tasks_stand_in_the_order_of_the_paper_and_unknown_ones_behind() {
    let mut rows = driven();
    rows.push(row("good", "Town06", "few", 0));
    rows.push(EpisodeRow { condition: "snow".into(), ..row("good", "Town01", "empty", 0) });
    let table = table_of(&rows);
    let order: Vec<_> = table.tasks.iter().map(|t| format!("{} {}", t.town, t.traffic)).collect();
    assert_eq!(
        order,
        [
            "Town03 empty",
            "Town03 regular",
            "Town03 dense",
            "Town07 empty",
            "Town07 regular",
            "Town07 dense",
            "Town06 few",
            "Town01 empty"
        ]
    );
}

#[test]
fn what_is_not_divided_is_not_there() {
    let all_failed: Vec<EpisodeRow> = (0..3)
        .map(|i| EpisodeRow {
            duration_s: 0.0,
            driven_m: 0.0,
            ..failed(row("a", "Town03", "empty", i), "timeout")
        })
        .collect();
    let table = table_of(&all_failed);
    let cell = &table.systems[0].pooled;
    for key in ["wl", "ovsp", "ovsp_success", "wl_mean", "infractions_per_km", "at_fault", "speed"]
    {
        assert_eq!(cell.of(key).value, None, "{key}");
        assert_eq!(cell.of(key).interval, None, "{key}");
    }
    assert_eq!(cell.of("sr").interval.unwrap()[0], 0.0);
    assert!(!table.has("wl"));
    assert!(!markdown::markdown(&table).contains("NaN"));
    assert!(!csv::csv(&table).contains("NaN"));
}

#[test]
fn crashed_episodes_are_in_no_number_and_lacking_ones_are_said() {
    let mut rows = driven();
    rows.retain(|r| {
        !(r.policy == "good" && r.town == "Town07" && r.traffic == "empty" && r.episode > 0)
    });
    let crashed =
        rows.iter_mut().find(|r| r.policy == "good" && r.traffic == "dense" && r.episode == 3);
    let crashed = crashed.unwrap();
    crashed.reason = "crashed".into();
    crashed.success = false;
    crashed.error = Some("no camera".into());
    let table = table_of(&rows);
    insta::assert_snapshot!(table.caveats.join("\n"), @r"
    `good` crashed in 1 of 31 episodes, which are in no number: Town07 dense 3; the first said: no camera.
    `good` lacks 5 of 36 episodes that others drove, and its numbers are over the rest: Town07 empty 1, Town07 empty 2, Town07 empty 3, Town07 empty 4 and 1 more.
    ");
    let good = system(&table, "good");
    assert_eq!((good.pooled.episodes, good.pooled.crashed, good.pooled.lacking), (30, 1, 5));
    let dense = &good.tasks[5];
    assert_eq!((dense.episodes, dense.crashed, dense.of("sr").k), (5, 1, Some(4)));
    let empty = &good.tasks[3];
    assert_eq!((empty.episodes, empty.lacking, empty.of("sr").n), (1, 5, 1));
    // Only what both drove to an end is compared.
    let pooled = table.comparisons[0].pooled.as_ref().unwrap();
    assert_eq!((pooled.first, pooled.second), ([28, 30], [6, 30]));
    assert_eq!((pooled.only_first, pooled.only_second), (Some(24), Some(2)));
}

#[test]
fn pairs_are_compared_on_the_same_episodes_and_verdicts_say_no_more_than_that() {
    let table = table_of(&driven());
    let found = &table.comparisons[0];
    assert_eq!((found.first.as_str(), found.second.as_str()), ("good", "poor"));
    assert_eq!(found.verdict, Verdict::FirstIsBetter);
    insta::assert_snapshot!(found.sentence, @"`good` succeeds more often than `poor`: 34/36 against 6/36 of the same episodes, 30 won by `good` alone and 2 by `poor` alone (exact McNemar p < 0.0001); after Holm over 6 tasks they differ in none");
    let pooled = found.pooled.as_ref().unwrap();
    assert_eq!((pooled.only_first, pooled.only_second), (Some(30), Some(2)));
    assert_eq!(pooled.p, mcnemar_exact(30, 2));
    // Five of six: no task can be significant alone, and Holm's correction makes six of it.
    let task = found.tasks[0].as_ref().unwrap();
    assert_eq!((task.p, task.p_holm), (mcnemar_exact(5, 0), 6.0 * mcnemar_exact(5, 0)));
    let wl = found.differences.iter().find(|d| d.metric == "wl").unwrap();
    assert_eq!((wl.episodes, wl.verdict), (36, Verdict::FirstIsBetter));
    near(wl.difference.unwrap(), -100.0 * 60.0 / 350.0);

    // The same episodes of another seed of the suite are other episodes.
    let mut rows = driven();
    rows.iter_mut().filter(|r| r.policy == "poor").for_each(|r| r.seed = 1);
    let table = table_of(&rows);
    let pooled = table.comparisons[0].pooled.as_ref().unwrap();
    assert_eq!((pooled.test, pooled.only_first), (Test::Fisher, None));
    assert_eq!(pooled.p, fisher_exact([34, 36], [6, 36]));
    insta::assert_snapshot!(table.comparisons[0].sentence, @"`good` succeeds more often than `poor`: 34/36 against 6/36 of unpaired episodes (exact Fisher p < 0.0001); after Holm over 6 tasks they differ in none");
    assert_eq!(table.caveats.len(), 2);

    let few: Vec<EpisodeRow> =
        driven().into_iter().filter(|r| r.traffic == "empty" && r.episode < 2).collect();
    let table = table_of(&few);
    assert_eq!(table.comparisons[0].verdict, Verdict::TooFew);
    insta::assert_snapshot!(table.comparisons[0].sentence, @"no difference in success can be claimed between `good` and `poor`, too few episodes for a claim: 4/4 against 2/4 of the same episodes, 2 won by `good` alone and 0 by `poor` alone (exact McNemar p = 0.5000); after Holm over 2 tasks they differ in none");
}

#[test]
fn files_that_do_not_belong_together_are_refused() {
    let refused = |change: fn(&mut EpisodeRow)| {
        let mut other = driven();
        other.iter_mut().for_each(|row| row.policy += "-2");
        change(&mut other[3]);
        let files =
            vec![("a/episodes.parquet".into(), driven()), ("b/episodes.parquet".into(), other)];
        let error = episodes::merge(files).unwrap_err();
        assert!(error.hint().is_some());
        error.to_string()
    };
    insta::assert_snapshot!(refused(|row| row.suite = "quick".into()), @"these are episodes of suite quick, others of deeptest: b/episodes.parquet");
    insta::assert_snapshot!(refused(|row| row.route_m = 501.0), @"`poor-2`'s Town07 dense 1 is not the episode of `good`'s Town07 dense 1: b/episodes.parquet");
    insta::assert_snapshot!(refused(|row| row.reason = "asleep".into()), @"`poor-2`'s Town07 dense 1 ended by `asleep`, which is unknown: b/episodes.parquet");
    insta::assert_snapshot!(refused(|row| { row.policy = "poor".into(); row.driven_m = 1.0; }), @"another outcome of `poor`'s Town07 dense 1 than before: b/episodes.parquet");
    // What is there twice counts once.
    let twice = vec![("a".into(), driven()), ("b".into(), driven())];
    assert_eq!(episodes::merge(twice).unwrap(), driven());
    assert!(episodes::merge(vec![("a".into(), Vec::new())]).is_err());
}

#[test]
fn seeds_of_one_model_are_one_system() {
    let mut rows = driven();
    let second = |row: &EpisodeRow| {
        let mut row = row.clone();
        row.policy = "good-2".into();
        if row.traffic == "regular" { failed(row, "off-route") } else { row }
    };
    let more: Vec<EpisodeRow> = rows.iter().filter(|r| r.policy == "good").map(second).collect();
    rows.extend(more);
    let group = |name: &str, policies: &[&str]| Group {
        name: name.into(),
        policies: policies.iter().map(ToString::to_string).collect(),
    };
    let groups = [group("model", &["good", "good-2"])];
    let table = summary::of_episodes(&rows, &groups, quick(), None).unwrap();
    let names: Vec<&str> = table.systems.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["model", "poor"]);
    let model = system(&table, "model");
    assert_eq!((model.pooled.of("sr").k, model.pooled.of("sr").n), (Some(56), 72));
    let of_seeds: Vec<_> = model.seeds.iter().map(|s| (s.policy.as_str(), s.sr.k)).collect();
    assert_eq!(of_seeds, [("good", Some(34)), ("good-2", Some(22))]);
    // Not Wilson's: episodes of one seed are not independent of each other.
    let [low, high] = model.pooled.of("sr").interval.unwrap();
    let [wilson_low, wilson_high] = Estimate::share(56, 72).interval.unwrap();
    assert!(low < wilson_low && high > wilson_high, "{low} {high}");
    let found = &table.comparisons[0];
    assert!(found.pooled.is_none() && found.tasks.iter().all(Option::is_none));
    insta::assert_snapshot!(found.sentence, @"`model` succeeds more often than `poor`: 77.8 % for `model` against 16.7 % for `poor` over 36 episodes that both drove (95 % interval of the difference 40.3 ... 76.4, of these seeds)");

    for wrong in [
        vec![group("m", &["goo"])],
        vec![group("poor", &["good"])],
        vec![group("m", &["good"]), group("m", &["poor"])],
    ] {
        assert!(matches!(
            summary::of_episodes(&rows, &wrong, quick(), None),
            Err(Error::Config { .. })
        ));
    }
}

/// Tables that have every field, and every one that may be null also as null.
pub(crate) fn of_every_kind() -> [Table; 4] {
    let group = Group { name: "both".into(), policies: vec!["good".into(), "poor".into()] };
    let mut rows = driven();
    rows.push(row("other", "Town03", "empty", 0));
    let merged = episodes::merge(vec![("a".into(), rows)]).unwrap();
    let paper = Paper::table().unwrap();
    [
        table_of(&driven()),
        summary::of_episodes(&merged, &[], quick(), Some(&paper)).unwrap(),
        summary::of_episodes(&merged, &[group], quick(), None).unwrap(),
        summary::of_paper(&paper),
    ]
}

#[test]
fn the_papers_table_comes_back_cell_by_cell() {
    let paper = Paper::table().unwrap();
    let names: Vec<&str> = paper.systems.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["CIL", "CIL-R", "INT", "PMP"]);
    // As printed in the paper, apart from the fixture.
    let printed = "38 16 16 33 11 0 0 0 0 16 11 0 \
                   83 55 38 33 22 16 22 11 11 11 11 11 \
                   16 33 11 83 5 5 38 22 5 94 61 16 \
                   100 72 88 100 77 77 100 83 72 100 88 83";
    let cells: Vec<&Cell> = paper.systems.iter().flat_map(|s| &s.tasks).collect();
    assert_eq!(cells.len(), 48);
    let floored: Vec<String> =
        cells.iter().map(|cell| (100 * cell.of("sr").k.unwrap() / 18).to_string()).collect();
    assert_eq!(floored.join(" "), printed);
    assert!(cells.iter().all(|cell| cell.of("sr").n == 18));
    // Rounding would not give these cells.
    let rounded = |cell: &&&Cell| {
        let k = cell.of("sr").k.unwrap() as f64;
        (100.0 * k / 18.0).round() == (100.0 * k / 18.0).floor()
    };
    assert_eq!(cells.len() - cells.iter().filter(rounded).count(), 17);
    for cell in cells {
        let has_success = cell.of("sr").k.unwrap() > 0;
        assert_eq!(cell.of("ovsp_success").value.is_some(), has_success);
        assert!(cell.of("wl").value.is_some());
    }
}

#[test]
fn the_papers_systems_over_all_tasks_have_these_intervals() {
    let paper = Paper::table().unwrap();
    let pooled = |system: &System| {
        let Estimate { value, k, n, interval } = system.pooled.of("sr");
        let [low, high] = interval.unwrap();
        format!("{} {}/{n} {:.1} % {low:.1}-{high:.1}", system.name, k.unwrap(), value.unwrap())
    };
    let pooled: Vec<String> = paper.systems.iter().map(pooled).collect();
    assert_eq!(
        pooled,
        [
            "CIL 26/216 12.0 % 8.3-17.1",
            "CIL-R 59/216 27.3 % 21.8-33.6",
            "INT 71/216 32.9 % 27.0-39.4",
            "PMP 188/216 87.0 % 81.9-90.9"
        ]
    );
    // Single cells are weak: of PMP against CIL-R on Town03, empty and regular.
    let table = summary::of_paper(&paper);
    let found = table
        .comparisons
        .iter()
        .find(|c| (c.first.as_str(), c.second.as_str()) == ("CIL-R", "PMP"));
    let p: Vec<String> =
        found.unwrap().tasks[..2].iter().map(|t| format!("{:.2}", t.as_ref().unwrap().p)).collect();
    assert_eq!(p, ["0.23", "0.49"]);
}

#[test]
fn every_cut_share_comes_back() {
    for n in 1..100 {
        for k in 0..=n {
            assert_eq!(successes(100 * k / n, n), k, "{k}/{n}");
        }
    }
}

#[test]
fn the_paper_stands_beside_its_own_tasks_only() {
    let paper = Paper::table().unwrap();
    let mut rows = driven();
    rows.push(row("good", "Town01", "empty", 0));
    let table = summary::of_episodes(&rows, &[], quick(), Some(&paper)).unwrap();
    let pmp = system(&table, "PMP");
    let k: Vec<_> = pmp.tasks.iter().map(|cell| cell.of("sr").k).collect();
    assert_eq!(k, [Some(18), Some(13), Some(16), Some(18), Some(15), Some(13), None]);
    assert_eq!((pmp.pooled.of("sr").k, pmp.pooled.of("sr").n), (Some(93), 108));
    assert_eq!(table.comparisons.len(), 1, "nothing is compared with the paper");
    insta::assert_snapshot!(table.caveats.last().unwrap(), @"The paper's systems drove CARLA 0.9.7, other routes and other traffic: they are set beside these, with success cut to whole per cents as printed, and no test compares the two; 6 of 7 tasks are the paper's, and its sums are over them.");

    let other =
        [Task { condition: "New-Town".into(), town: "town07".into(), traffic: "Dense".into() }];
    assert_eq!(paper.over(&other)[3].pooled.of("sr").k, Some(13));
}

/// `scripts/golden.sh` rewrites the texts; review their difference as you would review code.
#[test]
fn tables_read_as_they_read_before() {
    let rows: Vec<EpisodeRow> = driven().into_iter().filter(|r| r.town == "Town03").collect();
    let paper = Paper::table().unwrap();
    let table = summary::of_episodes(&rows, &[], quick(), Some(&paper)).unwrap();
    golden("driven.md", &markdown::markdown(&table));
    golden("driven.tex", &latex::latex(&table));
    let alone = summary::of_paper(&paper);
    golden("paper.md", &markdown::markdown(&alone));
    golden("paper.tex", &latex::latex(&alone));
}

#[track_caller]
#[allow(clippy::disallowed_methods, reason = "the script has no other way to speak to a test")]
fn golden(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/golden/tables").join(name);
    if std::env::var("PMP_UPDATE_GOLDEN").is_ok() {
        fs::write(&path, text).unwrap();
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    for (i, (ours, kept)) in text.lines().zip(kept.lines()).enumerate() {
        assert_eq!(ours, kept, "{name}, line {}; scripts/golden.sh rewrites it", i + 1);
    }
    assert_eq!(text.len(), kept.len(), "{name}");
}

#[test]
fn csv_and_json_hold_the_same_numbers() {
    let table = table_of(&driven());
    let text = csv::csv(&table);
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(head[..6], ["suite", "system", "source", "condition", "town", "traffic"]);
    assert_eq!(
        head[6..],
        ["metric", "unit", "value", "k", "n", "low", "high", "episodes", "crashed", "lacking"]
    );
    let lines: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert!(lines.iter().all(|line| line.len() == head.len()));
    // Two systems, 6 tasks, 2 conditions and all together.
    assert_eq!(lines.len(), 2 * (6 + 2 + 1) * METRICS.len());
    let line =
        lines.iter().find(|l| l[1..7] == ["poor", "driven", "all", "all", "all", "wl"]).unwrap();
    let wl = system(&table, "poor").pooled.of("wl");
    assert_eq!(line[8].parse::<f64>().unwrap(), wl.value.unwrap());
    assert_eq!(line[11].parse::<f64>().unwrap(), wl.interval.unwrap()[0]);
    let again: Table = serde_json::from_str(&table::json(&table).unwrap()).unwrap();
    assert_eq!(again, table);
    assert_eq!(table_of(&driven()), table, "the same rows, the same table");
}

#[test]
fn tables_are_written_beside_the_episodes() {
    let (folder, _) = kept(&driven());
    table::write(folder.path(), &driven()).unwrap();
    let mut names: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["episodes.parquet", "table.csv", "table.md", "table.tex"]);
    let rows = table::read(&[folder.path().to_path_buf()]).unwrap();
    let again = summary::of_episodes(&rows, &[], Bootstrap::default(), None).unwrap();
    let written = fs::read_to_string(folder.path().join("table.md")).unwrap();
    assert_eq!(written, markdown::markdown(&again));
}
