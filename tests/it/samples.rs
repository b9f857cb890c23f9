//! Frames into samples into batches: pictures, returns, labels and masks.

use candle_core::Device::Cpu;
use half::f16;
use pmp::{
    dataset::{
        augment::Disturbance,
        batch::{Batch, Inputs},
        sample::{InputSize, Sample},
    },
    frame::{
        Command, Conditions, Frame, Future, IMAGE_HEIGHT, IMAGE_WIDTH, LidarPixels, RadarPixels,
        RecordedAction, Route, RouteSource, Skew,
    },
};

const SIZE: Option<InputSize> = Some(InputSize { height: 32, width: 80 });

/// Left half red, right half blue, no returns.
pub(crate) fn frame() -> Frame {
    let rgb: Vec<u8> = (0..IMAGE_HEIGHT * IMAGE_WIDTH)
        .flat_map(|i| if i % IMAGE_WIDTH < 300 { [255, 0, 0] } else { [0, 0, 255] })
        .collect();
    let mut image = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut image, 95);
    let (width, height) = (IMAGE_WIDTH as u16, IMAGE_HEIGHT as u16);
    encoder.encode(&rgb, width, height, jpeg_encoder::ColorType::Rgb).unwrap();
    Frame {
        index: 7,
        stamp_ns: 0,
        image,
        lidar: Some(LidarPixels::default()),
        radar: None,
        velocity_mps: [5.0, 0.1],
        yaw_rad: 0.0,
        position_m: [0.0; 3],
        action: RecordedAction { steer: Some(-0.2), throttle: Some(0.5), brake: None },
        route: Route {
            waypoints_m: std::array::from_fn(|i| if i % 2 == 0 { 0.2 * i as f32 } else { 0.0 }),
            len: 130,
            source: RouteSource::Driven,
        },
        command: Command::Right,
        future: Future { speed_mps: [4.0; 30], yaw_rad: [0.25; 30], xy_m: [0.0; 60], len: 12 },
        skew: Skew::default(),
        conditions: Conditions::default(),
        in_junction: None,
        speed_limit_mps: None,
        perturbed: false,
    }
}

fn halves(values: &[f32]) -> Vec<f16> {
    values.iter().map(|v| f16::from_f32(*v)).collect()
}

#[test]
fn picture_is_shrunk_by_area_and_kept_in_its_colours() {
    let sample = Sample::new(&frame(), SIZE).unwrap();
    let at = |channel: usize, row: usize, column: usize| {
        sample.camera[(row * 80 + column) * 3 + channel]
    };
    for row in 0..32 {
        assert!(at(0, row, 3) > 245 && at(2, row, 3) < 10, "left is red");
        assert!(at(0, row, 76) < 10 && at(2, row, 76) > 245, "right is blue");
    }
    assert_eq!(sample.present, [true, true]);
}

#[test]
fn nearest_lidar_return_and_fastest_radar_return_win_a_pixel() {
    let mut frame = frame();
    // Columns 0 and 1 of row 0 fall on one pixel of 32 x 80, column 599 of row 249 on the last.
    frame.lidar = Some(LidarPixels {
        pixel: vec![0, 1, 249 * 600 + 599],
        x: halves(&[1.0, 2.0, 3.0]),
        y: halves(&[-1.0, -2.0, -3.0]),
        z: halves(&[20.0, 10.0, 30.0]),
    });
    frame.radar =
        Some(RadarPixels { pixel: vec![0, 1, 2], speed_mps: Some(halves(&[2.0, -6.0, 5.0])) });
    let sample = Sample::new(&frame, SIZE).unwrap();
    let pixel = |at: usize| -> Vec<f32> {
        let place = sample.ralidar_pixel.iter().position(|pixel| *pixel == at as u32);
        place.map_or(vec![0.0; 4], |place| sample.ralidar[place].map(f32::from).to_vec())
    };
    assert_eq!(pixel(0), [2.0, -2.0, 10.0, -6.0]);
    assert_eq!(pixel(1), [0.0; 4]);
    assert_eq!(pixel(32 * 80 - 1), [3.0, -3.0, 30.0, 0.0]);
}

#[test]
fn batch_carries_labels_with_masks_and_sensors_with_presence() {
    let mut blind = frame();
    (blind.image, blind.lidar, blind.perturbed) = (vec![], None, true);
    let samples = [Sample::new(&frame(), SIZE).unwrap(), Sample::new(&blind, SIZE).unwrap()];
    let names = vec!["a/7".to_string(), "b/8".to_string()];
    let batch = Batch::stack(&samples, names, &|_| Disturbance::none(), &Cpu).unwrap();
    let second = &batch.split(2).unwrap()[1];
    assert_eq!((second.size().unwrap(), &second.frames[..]), (1, &["b/8".to_string()][..]));
    let Batch { inputs, targets, .. } = batch;
    assert_eq!(inputs.camera.as_ref().unwrap().dims(), [2, 32, 80, 3]);
    assert_eq!(inputs.ralidar.as_ref().unwrap().dims(), [2, 32, 80, 4]);
    assert_eq!(inputs.present.to_vec2::<f32>().unwrap(), [[1.0, 1.0], [0.0, 0.0]]);
    assert_eq!(inputs.velocity.to_vec2::<f32>().unwrap()[0], [5.0, 0.1]);
    assert_eq!(inputs.route.to_vec2::<f32>().unwrap()[1][258], 0.2 * 258.0);
    assert_eq!(inputs.command.to_vec1::<u32>().unwrap(), [2, 2]);
    assert_eq!(targets.action.to_vec2::<f32>().unwrap()[0], [-0.2, 0.5, 0.0]);
    assert_eq!(targets.action_known.to_vec2::<f32>().unwrap()[1], [1.0, 1.0, 0.0]);
    assert_eq!(targets.speed_mps.to_vec1::<f32>().unwrap()[0], 5f32.hypot(0.1));
    let valid = targets.motion_valid.to_vec2::<f32>().unwrap();
    assert_eq!(valid[0].iter().sum::<f32>(), 12.0);
    assert_eq!(valid[1].iter().sum::<f32>(), 0.0, "a disturbed car does not do as it is told");
    let motion = targets.motion.to_vec3::<f32>().unwrap();
    assert_eq!((&motion[0][11], &motion[0][12]), (&vec![4.0, 0.25], &vec![0.0, 0.0]));
    let top = inputs.camera.unwrap().max_all().unwrap().to_scalar::<f32>().unwrap();
    assert!((0.98..=1.0).contains(&top), "pictures are in 0 ... 1");
}

#[test]
fn network_without_pictures_does_not_decode_them() {
    let mut broken = frame();
    broken.image = vec![1, 2, 3];
    let sample = Sample::new(&broken, None).unwrap();
    assert!(sample.camera.is_empty() && sample.ralidar.is_empty());
    assert!(Inputs::stack(&[sample], &Cpu).unwrap().camera.is_none());
}

#[test]
fn picture_that_cannot_be_used_names_its_frame() {
    let mut broken = frame();
    broken.image = vec![1, 2, 3];
    let error = Sample::new(&broken, SIZE).unwrap_err().to_string();
    assert!(error.starts_with("picture of frame 7: "), "{error}");

    let mut outside = frame();
    outside.radar = Some(RadarPixels { pixel: vec![250 * 600], speed_mps: Some(halves(&[1.0])) });
    let error = Sample::new(&outside, SIZE).unwrap_err().to_string();
    assert_eq!(error, "picture of frame 7: radar pixel 150000 is outside of 600 x 250");
}
