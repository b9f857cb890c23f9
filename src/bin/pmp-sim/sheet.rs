//! `pmp-sim sheet`: what the camera sees under all skies.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    atomic,
    cli::Outcome,
    error::{Error, Result},
    sim::{
        senses_sheet,
        sheet::{self, Sheet as Pictures},
    },
    world::town::Town,
};

/// Draw what the camera sees: one moment under 16 skies, and four levels of traffic
///
/// Rows: daytime, sunset, night, dark; columns: clear, drizzle, rainy, storm. The last row has a
/// clear day with empty, little, regular and dense traffic. With --senses, one moment by all sensors:
/// camera with the boxes of others, and in a storm in the dark; lidar by height, on that day and in
/// that storm; lidar by distance; radar by speed (blue comes nearer, red goes away).
#[derive(Args)]
pub(crate) struct Sheet {
    /// Picture to write, PNG. Replaces what is there
    #[arg(long, value_name = "FILE.png")]
    out: PathBuf,

    /// One moment by all sensors, in place of many skies
    #[arg(long)]
    senses: bool,

    /// Town to drive in
    #[arg(long, value_name = "T", default_value = "Town03")]
    town: String,

    /// What route, traffic and people are drawn from
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
}

pub(crate) fn run(args: &Sheet) -> Result<Outcome> {
    let Sheet { out, senses, town, seed } = args;
    let town = Town::choose(None, std::slice::from_ref(town))?.remove(0);
    let Pictures { width, height, rgb } =
        if *senses { senses_sheet::draw(town, *seed)? } else { sheet::draw(&town, *seed)? };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    let write = |error: png::EncodingError| Error::io("write", out)(std::io::Error::other(error));
    let mut writer = encoder.write_header().map_err(write)?;
    writer.write_image_data(&rgb).map_err(write)?;
    writer.finish().map_err(write)?;
    atomic::write(out, &bytes)?;
    Ok(Outcome::Done)
}
