//! Names and types of a LeRobot dataset, and its `meta/info.json`.

use serde_json::{Map, Value, json};

use crate::frame::{Command, ROUTE_POINTS, RecordedAction};

/// Version of the layout.
pub const VERSION: &str = "v3.0";

/// Files in a folder `chunk-*`.
pub const FILES_PER_CHUNK: usize = 1000;

/// A file of rows is ended by the episode with which it has so many bytes of pictures.
pub const BYTES_PER_FILE: u64 = 100 << 20;

/// The picture.
pub const IMAGE: &str = "observation.images.front";

/// Velocity (vx, vy) in the ego frame, m/s.
pub const STATE: &str = "observation.state";

/// The way ahead in the ego frame, x1, y1, x2, y2, ... m.
pub const ROUTE: &str = "observation.route";

/// What the driver did.
pub const ACTION: &str = "action";

/// A channel of an action: its name, and what a frame says of it.
pub type Channel = (&'static str, fn(&RecordedAction) -> Option<f32>);

/// Channels that an action can have.
pub const CHANNELS: [Channel; 3] = [
    ("steer", |action| action.steer),
    ("throttle", |action| action.throttle),
    ("brake", |action| action.brake),
];

/// Columns that every LeRobot dataset has.
pub const INDEXES: [&str; 5] = ["timestamp", "frame_index", "episode_index", "index", "task_index"];

/// A command as a sentence: the tasks, in the order of their numbers.
pub fn task(command: Command) -> &'static str {
    match command {
        Command::Follow => "follow the road",
        Command::Left => "turn left at the junction",
        Command::Right => "turn right at the junction",
        Command::Straight => "go straight on at the junction",
    }
}

/// The number of a command's task.
pub fn task_index(command: Command) -> usize {
    Command::ALL.iter().position(|known| *known == command).unwrap_or_default()
}

/// Path of the n-th file below a folder.
pub fn chunk_file(folder: &str, number: usize) -> String {
    let [chunk, file] = chunk_and_file(number);
    format!("{folder}/chunk-{chunk:03}/file-{file:03}.parquet")
}

/// Its two numbers.
pub fn chunk_and_file(number: usize) -> [usize; 2] {
    [number / FILES_PER_CHUNK, number % FILES_PER_CHUNK]
}

/// What the columns are: names, types, shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Pixels.
    pub width: usize,
    pub height: usize,
    /// Indexes in [`CHANNELS`] of those that the dataset has.
    pub channels: Vec<usize>,
}

impl Features {
    /// Columns of vectors with their lengths.
    pub fn vectors(&self) -> [(&'static str, usize); 3] {
        [(STATE, 2), (ROUTE, 2 * ROUTE_POINTS), (ACTION, self.channels.len())]
    }

    fn names(&self, column: &str) -> Value {
        match column {
            STATE => json!(["vx_mps", "vy_mps"]),
            ACTION => self.channels.iter().map(|channel| json!(CHANNELS[*channel].0)).collect(),
            _ => {
                let axes = ["x", "y"];
                (0..2 * ROUTE_POINTS)
                    .map(|i| json!(format!("{}{}_m", axes[i % 2], i / 2)))
                    .collect()
            }
        }
    }

    /// As `meta/info.json` lists them.
    fn info(&self) -> Value {
        let mut features = Map::new();
        let image = json!({
            "dtype": "image",
            "shape": [self.height, self.width, 3],
            "names": ["height", "width", "channels"],
        });
        features.insert(IMAGE.into(), image);
        for (name, len) in self.vectors() {
            let vector = json!({ "dtype": "float32", "shape": [len], "names": self.names(name) });
            features.insert(name.into(), vector);
        }
        for name in INDEXES {
            let dtype = if name == "timestamp" { "float32" } else { "int64" };
            features.insert(name.into(), json!({ "dtype": dtype, "shape": [1], "names": null }));
        }
        Value::Object(features)
    }

    /// As Hugging Face's reader wants them in a Parquet file's footer, to show pictures as such.
    pub fn of_footer(&self) -> Value {
        let number = |dtype: &str| json!({ "dtype": dtype, "_type": "Value" });
        let mut features = Map::new();
        features.insert(IMAGE.into(), json!({ "_type": "Image" }));
        for (name, len) in self.vectors() {
            let list = json!({ "feature": number("float32"), "length": len, "_type": "List" });
            // A vector of one is a number.
            features.insert(name.into(), if len == 1 { number("float32") } else { list });
        }
        for name in INDEXES {
            let dtype = if name == "timestamp" { "float32" } else { "int64" };
            features.insert(name.into(), number(dtype));
        }
        json!({ "info": { "features": features } })
    }
}

/// Sums that `meta/info.json` has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    pub fps: u32,
    pub frames: usize,
    pub train_episodes: usize,
    pub episodes: usize,
}

/// `meta/info.json`.
pub fn info(features: &Features, totals: &Totals) -> Value {
    let mut splits = Map::new();
    let Totals { train_episodes, episodes, .. } = *totals;
    for (name, from, to) in [("train", 0, train_episodes), ("val", train_episodes, episodes)] {
        if from < to {
            splits.insert(name.into(), json!(format!("{from}:{to}")));
        }
    }
    json!({
        "codebase_version": VERSION,
        "robot_type": "car",
        "total_episodes": episodes,
        "total_frames": totals.frames,
        "total_tasks": Command::ALL.len(),
        "chunks_size": FILES_PER_CHUNK,
        "data_files_size_in_mb": BYTES_PER_FILE >> 20,
        "video_files_size_in_mb": 200,
        "fps": totals.fps,
        "splits": splits,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": null,
        "features": features.info(),
    })
}
