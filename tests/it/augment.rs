//! What is done to frames before they are learned from.

use candle_core::Device::Cpu;
use half::f16;
use pmp::{
    dataset::{
        augment::AugmentConfig,
        batch::Inputs,
        sample::{InputSize, Sample},
    },
    frame::LidarPixels,
};

use crate::samples::frame;

const EVERYTHING: AugmentConfig = AugmentConfig {
    brightness: 0.4,
    contrast: 0.3,
    colour: 0.1,
    point_dropout: 0.25,
    camera_dropout: 0.2,
    ralidar_dropout: 0.2,
};

fn samples(count: usize) -> Vec<Sample> {
    let size = Some(InputSize { height: 32, width: 80 });
    let mut frame = frame();
    let pixel: Vec<u32> = (0..40).map(|i| i * 3000 + 7).collect();
    let number = |x: f32| vec![f16::from_f32(x); pixel.len()];
    let (x, y, z) = (number(1.0), number(-1.0), number(20.0));
    frame.lidar = Some(LidarPixels { pixel, x, y, z });
    vec![Sample::new(&frame, size).unwrap(); count]
}

fn stacked(augment: &AugmentConfig, seed: u64, step: u64, count: usize) -> Inputs {
    let disturbance = |row| augment.disturbance(seed, step, row);
    Inputs::stack_disturbed(&samples(count), &disturbance, &Cpu).unwrap()
}

fn camera(inputs: &Inputs) -> Vec<f32> {
    inputs.camera.as_ref().unwrap().flatten_all().unwrap().to_vec1().unwrap()
}

fn ralidar(inputs: &Inputs) -> Vec<f32> {
    inputs.ralidar.as_ref().unwrap().flatten_all().unwrap().to_vec1().unwrap()
}

#[test]
fn nothing_asked_for_is_nothing_done() {
    let plain = Inputs::stack(&samples(2), &Cpu).unwrap();
    let none = stacked(&AugmentConfig::default(), 1, 2, 2);
    assert_eq!(camera(&plain), camera(&none));
    assert_eq!(ralidar(&plain), ralidar(&none));
}

#[test]
fn disturbance_is_a_function_of_seed_step_and_row() {
    let of = |seed, step| camera(&stacked(&EVERYTHING, seed, step, 3));
    assert_eq!(of(1, 2), of(1, 2));
    assert_ne!(of(1, 2), of(2, 2));
    assert_ne!(of(1, 2), of(1, 3));
    let rows = of(1, 2);
    let size = rows.len() / 3;
    assert_ne!(rows[..size], rows[size..2 * size]);
}

#[test]
fn tones_stay_in_range_and_points_and_sensors_go_missing_as_often_as_asked() {
    let inputs = stacked(&EVERYTHING, 5, 7, 400);
    assert!(camera(&inputs).iter().all(|x| (0.0..=1.0).contains(x)));
    let present = inputs.present.to_vec2::<f32>().unwrap();
    let missing = |sensor: usize| present.iter().filter(|row| row[sensor] == 0.0).count() as f64;
    assert!((missing(0) / 400.0 - 0.2).abs() < 0.06, "{}", missing(0));
    assert!((missing(1) / 400.0 - 0.16).abs() < 0.06, "{}", missing(1));
    assert!(present.iter().all(|row| row[0] + row[1] > 0.0), "one sensor stays");

    let points = |inputs: &Inputs| ralidar(inputs).chunks(4).filter(|v| v[2] != 0.0).count() as f64;
    let whole = points(&Inputs::stack(&samples(400), &Cpu).unwrap());
    assert!(whole > 0.0);
    let there = present.iter().filter(|row| row[1] == 1.0).count() as f64 / 400.0;
    let share = points(&inputs) / (whole * there);
    assert!((share - 0.75).abs() < 0.08, "{share}");
}
