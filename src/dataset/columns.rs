//! Frames to Arrow columns and back: dataset schema version 1.
//!
//! What each column means, with its unit, is in `schemas/frame.v1.json`; a test holds this file
//! against it.

use std::{collections::HashMap, sync::Arc};

use arrow::{
    array::{
        Array, ArrayRef, ArrowPrimitiveType, AsArray, BinaryArray, BooleanArray,
        FixedSizeListArray, ListArray, PrimitiveArray, RecordBatch, StringArray, UInt8Array,
    },
    buffer::{NullBuffer, OffsetBuffer},
    datatypes::{
        DataType, Field, Float16Type, Float32Type, Float64Type, Int32Type, Schema, SchemaRef,
        TimeUnit, TimestampNanosecondType, UInt8Type, UInt32Type,
    },
    error::ArrowError,
};

use half::f16;

use crate::frame::{
    Command, Conditions, FUTURE_STEPS, Frame, Future, LidarPixels, ROUTE_POINTS, RadarPixels,
    RecordedAction, Route, RouteSource, Skew,
};

/// Version of the frame columns; written into every shard and into the manifest.
pub const SCHEMA_VERSION: u32 = 1;

/// Key of [`SCHEMA_VERSION`] in a shard's metadata.
pub const VERSION_KEY: &str = "pmp.frame_schema";

/// The columns of a shard.
pub fn schema() -> SchemaRef {
    let list = |item| DataType::List(Arc::new(Field::new("item", item, false)));
    let fixed = |item, len: usize| {
        DataType::FixedSizeList(Arc::new(Field::new("item", item, false)), len as i32)
    };
    let required = |name: &str, data_type| Field::new(name, data_type, false);
    let nullable = |name: &str, data_type| Field::new(name, data_type, true);
    let stamp = DataType::Timestamp(TimeUnit::Nanosecond, Some("UTC".into()));
    let fields = vec![
        required("episode", DataType::Utf8),
        required("frame", DataType::UInt32),
        required("stamp", stamp),
        required("image", DataType::Binary),
        nullable("lidar_pixel", list(DataType::UInt32)),
        nullable("lidar_x", list(DataType::Float16)),
        nullable("lidar_y", list(DataType::Float16)),
        nullable("lidar_z", list(DataType::Float16)),
        nullable("radar_pixel", list(DataType::UInt32)),
        nullable("radar_speed", list(DataType::Float16)),
        required("velocity", fixed(DataType::Float32, 2)),
        required("yaw", DataType::Float64),
        required("position", fixed(DataType::Float64, 3)),
        nullable("steer", DataType::Float32),
        nullable("throttle", DataType::Float32),
        nullable("brake", DataType::Float32),
        required("route", fixed(DataType::Float32, 2 * ROUTE_POINTS)),
        required("route_len", DataType::UInt8),
        required("route_source", DataType::Utf8),
        required("command", DataType::Utf8),
        required("future_speed", fixed(DataType::Float32, FUTURE_STEPS)),
        required("future_yaw", fixed(DataType::Float32, FUTURE_STEPS)),
        required("future_xy", fixed(DataType::Float32, 2 * FUTURE_STEPS)),
        required("future_len", DataType::UInt8),
        nullable("image_skew", DataType::Int32),
        nullable("lidar_skew", DataType::Int32),
        nullable("radar_skew", DataType::Int32),
        nullable("control_skew", DataType::Int32),
        nullable("town", DataType::Utf8),
        nullable("weather", DataType::Utf8),
        nullable("illumination", DataType::Utf8),
        nullable("traffic", DataType::Utf8),
        nullable("in_junction", DataType::Boolean),
        nullable("speed_limit", DataType::Float32),
        required("perturbed", DataType::Boolean),
    ];
    let version = (VERSION_KEY.to_string(), SCHEMA_VERSION.to_string());
    Arc::new(Schema::new_with_metadata(fields, HashMap::from([version])))
}

/// Half floats of a frame; `None` is null.
pub type Halves = fn(&Frame) -> Option<&[f16]>;

/// The columns of half floats.
pub const HALVES: [(&str, Halves); 4] = [
    ("lidar_x", |frame| frame.lidar.as_ref().map(|lidar| lidar.x.as_slice())),
    ("lidar_y", |frame| frame.lidar.as_ref().map(|lidar| lidar.y.as_slice())),
    ("lidar_z", |frame| frame.lidar.as_ref().map(|lidar| lidar.z.as_slice())),
    ("radar_speed", |frame| frame.radar.as_ref()?.speed_mps.as_deref()),
];

/// Frames of one episode as columns, in the order of [`schema`].
///
/// # Errors
///
/// If Arrow finds the columns inconsistent, which would be a bug.
pub fn to_columns(episode: &str, frames: &[Frame]) -> Result<RecordBatch, ArrowError> {
    let [lidar_x, lidar_y, lidar_z, radar_speed] =
        HALVES.map(|(_, pick)| list::<Float16Type>(frames, pick));
    let text = |pick: fn(&Conditions) -> &Option<String>| -> ArrayRef {
        Arc::new(frames.iter().map(|f| pick(&f.conditions).as_deref()).collect::<StringArray>())
    };
    let scalar = |pick: fn(&Frame) -> Option<f32>| -> ArrayRef {
        Arc::new(frames.iter().map(pick).collect::<PrimitiveArray<Float32Type>>())
    };
    let skew = |pick: fn(&Skew) -> Option<i32>| -> ArrayRef {
        Arc::new(frames.iter().map(|f| pick(&f.skew)).collect::<PrimitiveArray<Int32Type>>())
    };
    let byte = |pick: fn(&Frame) -> u8| -> ArrayRef {
        Arc::new(frames.iter().map(pick).map(Some).collect::<UInt8Array>())
    };
    let stamps = frames.iter().map(|f| Some(f.stamp_ns));
    let stamps = stamps.collect::<PrimitiveArray<TimestampNanosecondType>>().with_timezone("UTC");
    let columns: Vec<ArrayRef> = vec![
        Arc::new(frames.iter().map(|_| Some(episode)).collect::<StringArray>()),
        Arc::new(frames.iter().map(|f| Some(f.index)).collect::<PrimitiveArray<UInt32Type>>()),
        Arc::new(stamps),
        Arc::new(frames.iter().map(|f| Some(f.image.as_slice())).collect::<BinaryArray>()),
        list::<UInt32Type>(frames, |frame| frame.lidar.as_ref().map(|l| l.pixel.as_slice())),
        lidar_x,
        lidar_y,
        lidar_z,
        list::<UInt32Type>(frames, |frame| frame.radar.as_ref().map(|r| r.pixel.as_slice())),
        radar_speed,
        fixed::<Float32Type>(frames, 2, |frame| &frame.velocity_mps),
        Arc::new(frames.iter().map(|f| Some(f.yaw_rad)).collect::<PrimitiveArray<Float64Type>>()),
        fixed::<Float64Type>(frames, 3, |frame| &frame.position_m),
        scalar(|frame| frame.action.steer),
        scalar(|frame| frame.action.throttle),
        scalar(|frame| frame.action.brake),
        fixed::<Float32Type>(frames, 2 * ROUTE_POINTS, |frame| &frame.route.waypoints_m),
        byte(|frame| frame.route.len),
        Arc::new(frames.iter().map(|f| Some(f.route.source.name())).collect::<StringArray>()),
        Arc::new(frames.iter().map(|f| Some(f.command.name())).collect::<StringArray>()),
        fixed::<Float32Type>(frames, FUTURE_STEPS, |frame| &frame.future.speed_mps),
        fixed::<Float32Type>(frames, FUTURE_STEPS, |frame| &frame.future.yaw_rad),
        fixed::<Float32Type>(frames, 2 * FUTURE_STEPS, |frame| &frame.future.xy_m),
        byte(|frame| frame.future.len),
        skew(|skew| Some(skew.image_ns)),
        skew(|skew| skew.lidar_ns),
        skew(|skew| skew.radar_ns),
        skew(|skew| skew.control_ns),
        text(|conditions| &conditions.town),
        text(|conditions| &conditions.weather),
        text(|conditions| &conditions.illumination),
        text(|conditions| &conditions.traffic),
        Arc::new(frames.iter().map(|f| f.in_junction).collect::<BooleanArray>()),
        scalar(|frame| frame.speed_limit_mps),
        Arc::new(frames.iter().map(|f| Some(f.perturbed)).collect::<BooleanArray>()),
    ];
    RecordBatch::try_new(schema(), columns)
}

/// A list column; `None` is null.
fn list<T: ArrowPrimitiveType>(
    frames: &[Frame],
    pick: impl Fn(&Frame) -> Option<&[T::Native]>,
) -> ArrayRef {
    let lists: Vec<_> = frames.iter().map(pick).collect();
    let lengths = lists.iter().map(|list| list.map_or(0, <[_]>::len));
    let offsets = OffsetBuffer::from_lengths(lengths);
    let nulls = NullBuffer::from_iter(lists.iter().map(Option::is_some));
    let values = lists.iter().flatten().flat_map(|list| list.iter().copied());
    let values = PrimitiveArray::<T>::from_iter_values(values);
    let item = Arc::new(Field::new("item", T::DATA_TYPE, false));
    Arc::new(ListArray::new(item, offsets, Arc::new(values), Some(nulls)))
}

/// A column of lists of one length.
fn fixed<T: ArrowPrimitiveType>(
    frames: &[Frame],
    len: usize,
    pick: impl Fn(&Frame) -> &[T::Native],
) -> ArrayRef {
    let values = frames.iter().flat_map(|frame| pick(frame).iter().copied());
    let values = PrimitiveArray::<T>::from_iter_values(values);
    let item = Arc::new(Field::new("item", T::DATA_TYPE, false));
    Arc::new(FixedSizeListArray::new(item, len as i32, Arc::new(values), None))
}

/// Columns back to frames, each with its episode. Columns are found by name.
///
/// # Errors
///
/// A sentence, if a column is missing, has another type, or holds a word that is none of its.
pub fn to_frames(batch: &RecordBatch) -> Result<Vec<(String, Frame)>, String> {
    let columns = Columns::of(batch);
    (0..batch.num_rows()).map(|row| columns.frame(row)).collect()
}

/// A batch of rows, columns by name. Every reader's error is a sentence about the column.
pub struct Columns<'b> {
    batch: &'b RecordBatch,
}

impl<'b> Columns<'b> {
    pub fn of(batch: &'b RecordBatch) -> Self {
        Columns { batch }
    }

    /// Tick on the grid.
    pub fn index(&self, row: usize) -> Result<u32, String> {
        Ok(self.number::<UInt32Type>("frame", row)?.unwrap_or_default())
    }

    pub fn perturbed(&self, row: usize) -> Result<bool, String> {
        Ok(self.flag("perturbed", row)?.unwrap_or_default())
    }

    /// Steer, throttle, brake.
    pub fn action(&self, row: usize) -> Result<[Option<f32>; 3], String> {
        let number = |name: &str| self.number::<Float32Type>(name, row);
        Ok([number("steer")?, number("throttle")?, number("brake")?])
    }

    pub fn command(&self, row: usize) -> Result<Command, String> {
        let word = self.word("command", row)?;
        Command::from_name(&word).ok_or(format!("`{word}` is no command"))
    }

    pub fn velocity_mps(&self, row: usize) -> Result<[f32; 2], String> {
        self.fixed::<Float32Type, 2>("velocity", row)
    }

    /// Sample time minus grid time.
    pub fn skew(&self, row: usize) -> Result<Skew, String> {
        let number = |name: &str| self.number::<Int32Type>(name, row);
        Ok(Skew {
            image_ns: number("image_skew")?.unwrap_or_default(),
            lidar_ns: number("lidar_skew")?,
            radar_ns: number("radar_skew")?,
            control_ns: number("control_skew")?,
        })
    }

    fn word(&self, name: &str, row: usize) -> Result<String, String> {
        self.text(name, row)?.ok_or(format!("column `{name}` has a null"))
    }

    fn frame(&self, row: usize) -> Result<(String, Frame), String> {
        let source = self.word("route_source", row)?;
        let [steer, throttle, brake] = self.action(row)?;
        let lidar = match self.list::<UInt32Type>("lidar_pixel", row)? {
            Some(pixel) => Some(LidarPixels {
                pixel,
                x: self.list::<Float16Type>("lidar_x", row)?.unwrap_or_default(),
                y: self.list::<Float16Type>("lidar_y", row)?.unwrap_or_default(),
                z: self.list::<Float16Type>("lidar_z", row)?.unwrap_or_default(),
            }),
            None => None,
        };
        let radar = match self.list::<UInt32Type>("radar_pixel", row)? {
            Some(pixel) => Some(RadarPixels {
                pixel,
                speed_mps: self.list::<Float16Type>("radar_speed", row)?,
            }),
            None => None,
        };
        let frame = Frame {
            index: self.index(row)?,
            stamp_ns: self.number::<TimestampNanosecondType>("stamp", row)?.unwrap_or_default(),
            image: self.bytes("image", row)?,
            lidar,
            radar,
            velocity_mps: self.velocity_mps(row)?,
            yaw_rad: self.number::<Float64Type>("yaw", row)?.unwrap_or_default(),
            position_m: self.fixed::<Float64Type, 3>("position", row)?,
            action: RecordedAction { steer, throttle, brake },
            route: Route {
                waypoints_m: self.fixed::<Float32Type, { 2 * ROUTE_POINTS }>("route", row)?,
                len: self.number::<UInt8Type>("route_len", row)?.unwrap_or_default(),
                source: RouteSource::from_name(&source)
                    .ok_or(format!("`{source}` is no route source"))?,
            },
            command: self.command(row)?,
            future: Future {
                speed_mps: self.fixed::<Float32Type, FUTURE_STEPS>("future_speed", row)?,
                yaw_rad: self.fixed::<Float32Type, FUTURE_STEPS>("future_yaw", row)?,
                xy_m: self.fixed::<Float32Type, { 2 * FUTURE_STEPS }>("future_xy", row)?,
                len: self.number::<UInt8Type>("future_len", row)?.unwrap_or_default(),
            },
            skew: self.skew(row)?,
            conditions: Conditions {
                town: self.text("town", row)?,
                weather: self.text("weather", row)?,
                illumination: self.text("illumination", row)?,
                traffic: self.text("traffic", row)?,
            },
            in_junction: self.flag("in_junction", row)?,
            speed_limit_mps: self.number::<Float32Type>("speed_limit", row)?,
            perturbed: self.perturbed(row)?,
        };
        Ok((self.word("episode", row)?, frame))
    }

    /// The column if its row is not null.
    fn valid(&self, name: &str, row: usize) -> Result<Option<&ArrayRef>, String> {
        let column = self.batch.column_by_name(name).ok_or(format!("no column `{name}`"))?;
        Ok(Some(column).filter(|column| column.is_valid(row)))
    }

    fn number<T: ArrowPrimitiveType>(
        &self,
        name: &str,
        row: usize,
    ) -> Result<Option<T::Native>, String> {
        let Some(column) = self.valid(name, row)? else { return Ok(None) };
        let values = column.as_primitive_opt::<T>().ok_or_else(|| wrong(name, column))?;
        Ok(Some(values.value(row)))
    }

    fn text(&self, name: &str, row: usize) -> Result<Option<String>, String> {
        let Some(column) = self.valid(name, row)? else { return Ok(None) };
        let values = column.as_string_opt::<i32>().ok_or_else(|| wrong(name, column))?;
        Ok(Some(values.value(row).to_string()))
    }

    fn flag(&self, name: &str, row: usize) -> Result<Option<bool>, String> {
        let Some(column) = self.valid(name, row)? else { return Ok(None) };
        let values = column.as_boolean_opt().ok_or_else(|| wrong(name, column))?;
        Ok(Some(values.value(row)))
    }

    fn bytes(&self, name: &str, row: usize) -> Result<Vec<u8>, String> {
        let Some(column) = self.valid(name, row)? else { return Ok(Vec::new()) };
        let values = column.as_binary_opt::<i32>().ok_or_else(|| wrong(name, column))?;
        Ok(values.value(row).to_vec())
    }

    fn list<T: ArrowPrimitiveType>(
        &self,
        name: &str,
        row: usize,
    ) -> Result<Option<Vec<T::Native>>, String> {
        let Some(column) = self.valid(name, row)? else { return Ok(None) };
        let lists = column.as_list_opt::<i32>().ok_or_else(|| wrong(name, column))?;
        let values = lists.value(row);
        let values = values.as_primitive_opt::<T>().ok_or_else(|| wrong(name, column))?;
        Ok(Some(values.values().to_vec()))
    }

    fn fixed<T: ArrowPrimitiveType, const N: usize>(
        &self,
        name: &str,
        row: usize,
    ) -> Result<[T::Native; N], String> {
        let column = self.valid(name, row)?.ok_or(format!("column `{name}` has a null"))?;
        let lists = column.as_fixed_size_list_opt().ok_or_else(|| wrong(name, column))?;
        let values = lists.value(row);
        let values = values.as_primitive_opt::<T>().ok_or_else(|| wrong(name, column))?;
        let values: &[T::Native] = values.values();
        values.try_into().map_err(|_error| wrong(name, column))
    }
}

fn wrong(name: &str, column: &ArrayRef) -> String {
    format!("column `{name}` has type {}", column.data_type())
}
