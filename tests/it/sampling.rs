//! Which frames are shown, how often, and what is done to them first.

use std::{collections::BTreeMap, sync::Arc};

use pmp::{
    dataset::{
        balance::Balance,
        order::{Order, Position},
        traits::{Trait, Traits},
    },
    frame::Command,
};
use proptest::prelude::*;

/// Driving on: nothing that a balance would show more often.
fn plain() -> Traits {
    Traits::new([Some(0.0), Some(0.4), Some(0.0)], Command::Follow, [8.0, 0.0])
}

/// Braking hard.
fn braking() -> Traits {
    Traits::new([Some(0.0), Some(0.0), Some(1.0)], Command::Follow, [8.0, 0.0])
}

fn counts(traits: &[Vec<Traits>]) -> Vec<u64> {
    let mut counts = vec![0; Traits::COUNT];
    traits.iter().flatten().for_each(|traits| counts[traits.index()] += 1);
    counts
}

fn order(traits: Vec<Vec<Traits>>, strength: f64, seed: u64, batch: usize, window: usize) -> Order {
    let balance = Balance::new(&counts(&traits), strength);
    Order::new(Arc::new(traits), balance, seed, batch, window)
}

/// The frames of whole epochs, from the first step of one.
fn epoch(order: &mut Order, number: u64) -> Vec<Position> {
    let steps = order.steps_per_epoch();
    (number * steps..(number + 1) * steps).flat_map(|step| order.batch(step)).collect()
}

#[test]
fn traits_are_told_from_steering_pedals_command_and_speed() {
    let kinds = |traits: Traits| Trait::ALL.map(|which| traits.kind(which));
    assert_eq!(kinds(plain()), [0, 0, 0, 0]);
    assert_eq!(kinds(braking()), [0, 1, 0, 0]);
    let turn = Traits::new([Some(-0.35), None, None], Command::Right, [3.0, 0.0]);
    assert_eq!(kinds(turn), [3, 0, 2, 0]);
    let start = Traits::new([Some(0.6), Some(0.5), Some(0.0)], Command::Straight, [0.3, 0.3]);
    assert_eq!(kinds(start), [4, 0, 3, 1]);
    let stands = Traits::new([None, Some(0.0), Some(1.0)], Command::Left, [0.0, 0.0]);
    assert_eq!(kinds(stands), [0, 1, 1, 0]);
    assert_eq!(Traits::all().filter(|traits| *traits == start).count(), 1);
}

#[test]
fn without_balance_an_epoch_shows_every_frame_once_and_none_is_like_another() {
    let groups = vec![vec![plain(); 64]; 10];
    let mut order = order(groups, 0.0, 3, 32, 4);
    let first = epoch(&mut order, 0);
    let mut sorted = first.clone();
    sorted.sort_unstable();
    let all: Vec<Position> = (0..10).flat_map(|g| (0..64).map(move |r| (g, r))).collect();
    assert_eq!(sorted, all);
    let second = epoch(&mut order, 1);
    assert_ne!(first, second);
    // A batch mixes groups, those of one window.
    let mut groups: Vec<u32> = first[..32].iter().map(|(group, _)| *group).collect();
    groups.sort_unstable();
    groups.dedup();
    assert!((3..=4).contains(&groups.len()), "{groups:?}");
}

#[test]
fn rare_moments_are_shown_as_often_as_their_weight_says() {
    // 2 of 64 frames brake: even shares would be half of all, 16 times as often; 10 is the most.
    let mut group = vec![plain(); 64];
    (group[5], group[40]) = (braking(), braking());
    let balance = Balance::new(&counts(&vec![group.clone(); 50]), 1.0);
    let ratio = balance.weight(braking()) / balance.weight(plain());
    assert!((ratio - 10.0 / 1.0).abs() < 1e-9, "{ratio}");
    let mean = (62.0 * balance.weight(plain()) + 2.0 * balance.weight(braking())) / 64.0;
    assert!((mean - 1.0).abs() < 1e-12, "{mean}");
    let [[before_no, after_no], [before, after]] = balance.shares(Trait::Brake)[..] else {
        unreachable!()
    };
    assert!((before - 1.0 / 32.0).abs() < 1e-12 && (before + before_no - 1.0).abs() < 1e-12);
    assert!((after - balance.weight(braking()) / 32.0).abs() < 1e-12);
    assert!((after + after_no - 1.0).abs() < 1e-12);
    assert!(balance.table().contains("brake yes"));

    let mut order = order(vec![group; 50], 1.0, 1, 16, 8);
    let shown = epoch(&mut order, 0);
    assert_eq!(shown.len(), 3200);
    let mut times: BTreeMap<Position, u64> = BTreeMap::new();
    shown.iter().for_each(|position| *times.entry(*position).or_default() += 1);
    let of_brakes = shown.iter().filter(|(_, row)| matches!(row, 5 | 40)).count() as f64;
    assert!((of_brakes / 3200.0 - after).abs() < 0.01, "{of_brakes}");
    // Drawn evenly: every frame as often as its weight, up to the next whole number.
    for (position, times) in times {
        let weight = match position.1 {
            5 | 40 => balance.weight(braking()),
            _ => balance.weight(plain()),
        };
        assert!((times as f64 - weight).abs() < 1.0 + 1e-9, "{position:?}: {times} of {weight}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// A resumed training asks for a step out of the blue.
    #[test]
    fn a_batch_is_a_function_of_its_step(
        sizes in prop::collection::vec(1usize..70, 1..12),
        strength in 0.0f64..1.0,
        seed in any::<u64>(),
        batch in 1usize..90,
        window in 1usize..6,
        step in 0u64..60,
    ) {
        let traits = |(i, size): (usize, &usize)| -> Vec<Traits> {
            (0..*size).map(|row| if (row + i) % 9 == 0 { braking() } else { plain() }).collect()
        };
        let groups: Vec<Vec<Traits>> = sizes.iter().enumerate().map(traits).collect();
        let frames: usize = sizes.iter().sum();
        let mut one = order(groups.clone(), strength, seed, batch, window);
        let mut other = order(groups.clone(), strength, seed, batch, window);
        let walked = (0..=step).map(|step| one.batch(step)).last().unwrap();
        prop_assert_eq!(&walked, &other.batch(step));
        prop_assert_eq!(walked.len(), batch.min(frames));
        for (group, row) in walked {
            prop_assert!((row as usize) < groups[group as usize].len());
        }
    }
}

/// Ten million frames, of which a training sees batches from the start, the middle and the end.
#[test]
fn index_of_ten_million_frames_is_small_and_its_batches_cheap() {
    let groups = vec![vec![plain(); 64]; 156_250];
    let mut order = order(groups, 0.0, 0, 32, 32);
    let steps = order.steps_per_epoch();
    assert_eq!(steps, 312_500);
    for step in [0, steps / 2, steps - 1] {
        let batch = order.batch(step);
        assert_eq!(batch.len(), 32);
        let mut groups: Vec<u32> = batch.iter().map(|(group, _)| *group).collect();
        groups.sort_unstable();
        groups.dedup();
        assert!(groups.len() > 8, "a window of 32 groups is mixed: {groups:?}");
    }
}
