//! A map as a picture file, north up: SVG or PNG by the ending of its name.

use std::{fmt::Write as _, path::Path};

use glam::DVec2;

use crate::{
    atomic,
    error::{Error, Result},
    map::{
        canvas::Canvas,
        road_map::RoadMap,
        shapes::{BACKGROUND, Shape, shapes},
    },
};

/// Longest side of a PNG, pixels.
const LONGEST_PX: f64 = 2400.0;

/// Largest scale of a PNG, pixels a metre.
const LARGEST_SCALE: f64 = 8.0;

/// Empty border, m.
const MARGIN_M: f64 = 15.0;

/// Draw a map, and on top of it what stands `beside` its roads.
///
/// # Errors
///
/// [`Error::Config`] if the file ends neither in `.svg` nor in `.png`, [`Error::Io`] if it
/// cannot be written.
pub fn draw(map: &RoadMap, beside: &[Shape], path: &Path) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let mut shapes = shapes(map);
    shapes.extend_from_slice(beside);
    let frame = Frame::around(&shapes);
    let bytes = match ending.to_ascii_lowercase().as_str() {
        "svg" => svg(&shapes, &frame).into_bytes(),
        "png" => png(&shapes, &frame, path)?,
        _ => {
            return Err(Error::Config {
                key: "--picture".into(),
                what: format!("`{}` ends neither in .svg nor in .png", path.display()),
                hint: Some("name the picture map.png or map.svg".into()),
            });
        }
    };
    atomic::write(path, &bytes)?;
    Ok(())
}

/// The part of the plane that is drawn.
struct Frame {
    /// South-west and north-east corner, m.
    low_m: DVec2,
    high_m: DVec2,
}

impl Frame {
    fn around(shapes: &[Shape]) -> Self {
        let points = || shapes.iter().flat_map(|shape| shape.outline_m.iter().copied());
        let low_m = points().reduce(DVec2::min).unwrap_or(DVec2::ZERO);
        let high_m = points().reduce(DVec2::max).unwrap_or(DVec2::ZERO);
        Frame { low_m: low_m - MARGIN_M, high_m: high_m + MARGIN_M }
    }

    fn size_m(&self) -> DVec2 {
        self.high_m - self.low_m
    }

    /// A place from the north-west corner, x right and y down, m.
    fn offset_m(&self, place_m: DVec2) -> DVec2 {
        DVec2::new(place_m.x - self.low_m.x, self.high_m.y - place_m.y)
    }
}

fn svg(shapes: &[Shape], frame: &Frame) -> String {
    let DVec2 { x: width, y: height } = frame.size_m();
    let [r, g, b] = BACKGROUND;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.2} {height:.2}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>\n"
    );
    for Shape { outline_m, colour: [r, g, b], .. } in shapes {
        text.push_str("<path d=\"M");
        for point in outline_m {
            let DVec2 { x, y } = frame.offset_m(*point);
            // Writing to a string cannot fail.
            let _ = write!(text, "{x:.2} {y:.2} ");
        }
        let _ = writeln!(text, "z\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>");
    }
    text.push_str("</svg>\n");
    text
}

fn png(shapes: &[Shape], frame: &Frame, path: &Path) -> Result<Vec<u8>> {
    let size_m = frame.size_m();
    let scale = (LONGEST_PX / size_m.max_element()).min(LARGEST_SCALE);
    let [width, height] = (size_m * scale).ceil().max(DVec2::ONE).to_array().map(|n| n as usize);
    let mut canvas = Canvas::new(width, height, BACKGROUND);
    for shape in shapes {
        let outline_px: Vec<DVec2> =
            shape.outline_m.iter().map(|point| scale * frame.offset_m(*point)).collect();
        canvas.fill(&outline_px, shape.colour);
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    let write = |error: png::EncodingError| Error::io("write", path)(std::io::Error::other(error));
    let mut writer = encoder.write_header().map_err(write)?;
    writer.write_image_data(&canvas.into_rgb()).map_err(write)?;
    writer.finish().map_err(write)?;
    Ok(bytes)
}
