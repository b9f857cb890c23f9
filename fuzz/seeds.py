"""Seeds of the fuzz targets, by writers that are not pmp's: fuzz/corpus/TARGET/seed-*.

    pip install mcap rosbags protobuf foxglove-schemas-protobuf mcap-protobuf-support numpy pillow opencv-python-headless
    python fuzz/seeds.py
"""

import io
import json
import pathlib
import struct

import cv2
import numpy
from foxglove_schemas_protobuf import CompressedImage_pb2, FrameTransforms_pb2, PointCloud_pb2
from foxglove_schemas_protobuf import CameraCalibration_pb2, PoseInFrame_pb2, PosesInFrame_pb2
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set
from PIL import Image
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

CORPUS = pathlib.Path(__file__).parent / "corpus"
ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf/msg/tfMessage"))


def jpeg(shade):
    data = io.BytesIO()
    Image.new("RGB", (16, 8), (shade, 90, 30)).save(data, "jpeg")
    return data.getvalue()


def filled(store, kind, /, **fields):
    """A message of a type: what is not given is zero, empty or a message of zeros."""
    values = {}
    for field, (node, detail) in store.fielddefs[kind][1]:
        if field in fields:
            values[field] = fields[field]
        elif int(node) == 1:
            values[field] = "" if detail[0] == "string" else 0
        elif int(node) == 2:
            values[field] = filled(store, detail)
        else:
            (item_node, item), length = detail[0], detail[1] if int(node) == 3 else 0
            is_number = int(item_node) == 1 and item[0] != "string"
            bytes_ = {"byte": "uint8", "char": "uint8", "octet": "uint8"}
            values[field] = (
                numpy.zeros(length, bytes_.get(item[0], item[0])) if is_number
                else [filled(store, item) for _ in range(length)])
    return store.types[kind](**values)


def header(store, seconds, frame):
    stamp = filled(store, "builtin_interfaces/msg/Time", sec=100 + int(seconds), nanosec=int(seconds % 1 * 1e9))
    return filled(store, "std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def messages(store, seconds):
    """Topic, type and message of everything that a drive has, at one instant."""
    of = lambda kind, /, **fields: filled(store, kind, **fields)
    head = lambda frame: header(store, seconds, frame)
    point = of("geometry_msgs/msg/Point", x=5.0 * seconds)
    turned = of("geometry_msgs/msg/Quaternion", w=1.0)
    pose = of("geometry_msgs/msg/Pose", position=point, orientation=turned)
    stamped = of("geometry_msgs/msg/PoseStamped", header=head("map"), pose=pose)
    transform = lambda parent, child, x: of(
        "geometry_msgs/msg/TransformStamped", header=head(parent), child_frame_id=child,
        transform=of("geometry_msgs/msg/Transform", rotation=turned,
                     translation=of("geometry_msgs/msg/Vector3", x=x)))
    tf = "tf2_msgs/msg/TFMessage" if store is ROS2 else "tf/msg/tfMessage"
    field = lambda name, offset: of("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=7, count=1)
    cloud = lambda frame, names: of(
        "sensor_msgs/msg/PointCloud2", header=head(frame), height=1, width=3, point_step=16, row_step=48,
        fields=[field(name, 4 * i) for i, name in enumerate(names)],
        data=numpy.frombuffer(numpy.linspace(0, 9, 12, dtype="<f4").tobytes(), "uint8"))
    yield "/tf_static", tf, of(tf, transforms=[
        transform("base_link", "camera", 1.0), transform("base_link", "lidar", 0.5), transform("base_link", "radar", 2.0)])
    yield "/camera", "sensor_msgs/msg/CompressedImage", of(
        "sensor_msgs/msg/CompressedImage", header=head("camera"), format="jpeg",
        data=numpy.frombuffer(jpeg(int(seconds * 50)), "uint8"))
    info = "sensor_msgs/msg/CameraInfo"
    names = [field for field, _ in store.fielddefs[info][1]]
    k, d = ("k", "d") if "k" in names else ("K", "D")
    yield "/camera_info", info, of(info, header=head("camera"), width=16, height=8, distortion_model="plumb_bob", **{
        k: numpy.array([9.0, 0, 8, 0, 9, 4, 0, 0, 1]), d: numpy.array([0.1, 0, 0, 0, 0])})
    yield "/lidar", "sensor_msgs/msg/PointCloud2", cloud("lidar", ["x", "y", "z", "intensity"])
    yield "/radar", "sensor_msgs/msg/PointCloud2", cloud("radar", ["x", "y", "z", "velocity"])
    odometry = "nav_msgs/msg/Odometry"
    yield "/odom", odometry, of(
        odometry, header=head("map"), child_frame_id="base_link",
        pose=of("geometry_msgs/msg/PoseWithCovariance", pose=pose))
    yield "/plan", "nav_msgs/msg/Path", of("nav_msgs/msg/Path", header=head("map"), poses=[stamped, stamped])
    yield "/imu", "sensor_msgs/msg/Imu", of("sensor_msgs/msg/Imu", header=head("imu"))


def log(store, definition_encoding, message_encoding, **options):
    """A drive of half a second as an MCAP file."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=2048, **options)
    writer.start()
    version = 2 if store is ROS2 else 1
    serialize = store.serialize_cdr if store is ROS2 else store.serialize_ros1
    channels = {}
    for step in range(5):
        for topic, name, message in messages(store, step / 10):
            if topic not in channels:
                text, _ = store.generate_msgdef(name, ros_version=version)
                schema = writer.register_schema(name if version == 2 else name.replace("/msg/", "/"), definition_encoding, text.encode())
                channels[topic] = writer.register_channel(topic, message_encoding, schema)
            stamp = 100_000_000_000 + step * 100_000_000
            writer.add_message(channels[topic], stamp, bytes(serialize(message, name)), stamp)
    writer.add_metadata("pmp.conditions", {"town": "Town01", "weather": "clear"})
    writer.finish()
    return out.getvalue()


def parts(name, definition, message):
    """An input of a message target, see inputs.rs."""
    name = name.encode()
    return bytes([len(name)]) + name + struct.pack("<H", len(definition)) + definition + message


def save(target, name, data):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed-{name}").write_bytes(data)


save("mcap", "zstd", log(ROS2, "ros2msg", "cdr", compression=CompressionType.ZSTD))
save("mcap", "lz4", log(ROS1, "ros1msg", "ros1", compression=CompressionType.LZ4))
save("mcap", "plain", log(ROS2, "ros2msg", "cdr", compression=CompressionType.NONE))
save("mcap", "unchunked", log(ROS2, "ros2msg", "cdr", use_chunking=False))
save("mcap", "no-index", log(ROS2, "ros2msg", "cdr", use_summary_offsets=False, repeat_channels=False, repeat_schemas=False))

for topic, name, message in messages(ROS2, 0.3):
    text, _ = ROS2.generate_msgdef(name, ros_version=2)
    save("cdr", topic[1:], parts(name, text.encode(), bytes(ROS2.serialize_cdr(message, name))))
    big = bytes(ROS2.serialize_cdr(message, name, little_endian=False))
    save("cdr", topic[1:] + "-big-endian", parts(name, text.encode(), big))
    if topic in ("/lidar", "/radar"):
        save("cloud", topic[1:], bytes(ROS2.serialize_cdr(message, name)))
        save("cloud", topic[1:] + "-big-endian", big)
for topic, name, message in messages(ROS1, 0.3):
    text, _ = ROS1.generate_msgdef(name, ros_version=1)
    save("ros1", topic[1:], parts(name.replace("/msg/", "/"), text.encode(), bytes(ROS1.serialize_ros1(message, name))))

IDL = b"""module a { module msg {
  enum Colour { RED, GREEN };
  const long MOST = 3;
  struct Inner { double x; sequence<float, 4> bounded; };
  struct Outer { Inner inner; string text; long fixed[MOST]; Colour colour; boolean flag; octet byte; };
}; };
"""
OUTER = struct.pack("<d I2f I3sx 3i I ? B", 1.5, 2, 1.0, 2.0, 3, b"ab", 7, 8, 9, 1, True, 255)
save("cdr", "idl", parts("a/msg/Outer", IDL, b"\0\1\0\0" + OUTER))

stamp = lambda message, frame: (setattr(message, "frame_id", frame), message.timestamp.FromSeconds(100))
image = CompressedImage_pb2.CompressedImage(data=jpeg(7), format="jpeg")
cloud = PointCloud_pb2.PointCloud(point_stride=16, data=numpy.arange(8, dtype="<f4").tobytes())
for index, field in enumerate("x y z velocity".split()):
    cloud.fields.add(name=field, offset=4 * index, type=7)
calibration = CameraCalibration_pb2.CameraCalibration(width=16, height=8, K=[9.0, 0, 8, 0, 9, 4, 0, 0, 1])
placed = PoseInFrame_pb2.PoseInFrame()
placed.pose.position.x = 3.0
route = PosesInFrame_pb2.PosesInFrame()
route.poses.add().position.y = 2.0
for message in (image, cloud, calibration, placed, route):
    stamp(message, "base_link")
tree = FrameTransforms_pb2.FrameTransforms()
tree.transforms.add(parent_frame_id="base_link", child_frame_id="camera").rotation.w = 1.0
for message in (image, cloud, calibration, placed, route, tree):
    kind = type(message)
    descriptors = build_file_descriptor_set(kind).SerializeToString()
    save("protobuf", kind.DESCRIPTOR.name, parts(kind.DESCRIPTOR.full_name, descriptors, message.SerializeToString()))

TIME = {"sec": 100, "nsec": 5}
POSE = {"position": {"x": 1.5, "y": -2e3, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
SCHEMA = {"type": "object", "properties": {"data": {"type": "string", "contentEncoding": "base64"}, "timestamp": {
    "type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}, "frame_id": {"type": "string"}}}
for name, schema, message in [
    ("foxglove.CompressedImage", SCHEMA, {"timestamp": TIME, "frame_id": "camera", "data": "/9j/4AAQ", "format": "jpeg"}),
    ("foxglove.PoseInFrame", {}, {"timestamp": TIME, "frame_id": "map", "pose": POSE}),
    ("foxglove.PosesInFrame", {}, {"timestamp": TIME, "frame_id": "map", "poses": [POSE, POSE]}),
    ("any", {}, {"text": "a\u00e9\n", "deep": [[[[1, 2.5, True, None]]]], "list": [{"a": 1}, {"b": "c"}]}),
]:
    save("json", name.split(".")[-1], parts(name, json.dumps(schema).encode(), json.dumps(message).encode()))

# Noise in one half, so that there are numbers and codes of many lengths.
PIXELS = numpy.random.default_rng(1).integers(0, 256, (24, 40, 3), "uint8")
PIXELS[:, :20] = 90
SAMPLING = {"420": 0x221111, "422": 0x211111, "440": 0x121111, "444": 0x111111}
for name, options in {
    **{name: [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor] for name, factor in SAMPLING.items()},
    "fine": [cv2.IMWRITE_JPEG_QUALITY, 100],
    "coarse": [cv2.IMWRITE_JPEG_QUALITY, 10],
    "own-tables": [cv2.IMWRITE_JPEG_OPTIMIZE, 1],
    "restarts": [cv2.IMWRITE_JPEG_RST_INTERVAL, 2],
    "progressive": [cv2.IMWRITE_JPEG_PROGRESSIVE, 1],
}.items():
    save("jpeg", name, cv2.imencode(".jpg", PIXELS, options)[1].tobytes())
save("jpeg", "grey", cv2.imencode(".jpg", PIXELS[:, :, 0])[1].tobytes())
save("jpeg", "small", jpeg(40))
