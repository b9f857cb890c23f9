"""A drive that turns left, written as MCAP by one of several packages, and what numpy says of it.

    python writers.py rosbags-ros2 | rosbags-ros1 | mcap-ros2-support | mcap-protobuf-support | foxglove-sdk OUT.mcap

Prints one JSON object: for each of the first pictures' ticks the pixels of lidar and radar and the
motion, computed here from the arrays that were written. Nothing of pmp is used.
"""

import io
import json
import sys
from types import SimpleNamespace as Part

import numpy
from numpy import cos, sin
from PIL import Image

START_NS = 1_700_000_000_000_000_000
SPEED, RADIUS, SECONDS = 6.0, 30.0, 4.5
K = [200.0, 0, 158.5, 0, 190.0, 121.3, 0, 0, 1]
D = [-0.1, 0.02, 0.001, -0.0005, 0.005]
WIDTH, HEIGHT, STORED = 320, 240, (600, 250)
RANDOM = numpy.random.default_rng(5)


def about(axis, angle):
    """Quaternion (x, y, z, w) of a turn about an axis of unit length."""
    return numpy.array([*(sin(angle / 2) * numpy.array(axis, float)), cos(angle / 2)])


def times(a, b):
    """Product of two quaternions."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return numpy.array([
        aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz])


def matrix(q):
    x, y, z, w = q
    return numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


OPTICAL = numpy.array([-0.5, 0.5, -0.5, 0.5])  # z forward, x right, y down
MOUNTS = {  # base_link from sensor: translation, quaternion
    "camera": (numpy.array([1.5, 0.1, 1.4]), times(about([0, 1, 0], numpy.radians(4)), OPTICAL)),
    "lidar": (numpy.array([0.8, -0.2, 1.9]), about([0, 0, 1], numpy.radians(10))),
    "radar": (numpy.array([3.6, 0.0, 0.5]), about([0, 0, 1], numpy.radians(-3))),
}


def cloud(count, fields):
    """Random points ahead as packed little-endian float32."""
    azimuth, elevation = RANDOM.uniform(-0.7, 0.7, count), RANDOM.uniform(-0.3, 0.2, count)
    distance = RANDOM.uniform(2, 45, count)
    xyz = [distance * cos(azimuth) * cos(elevation), distance * sin(azimuth) * cos(elevation), distance * sin(elevation)]
    columns = xyz + [RANDOM.uniform(-9, 9, count)]
    return numpy.stack(columns, axis=1).astype("<f4"), fields


def pixels(points, sensor):
    """Ascending pixels of the nearest points, their position before the camera, and their rows."""
    (camera_t, camera_q), (t, q) = MOUNTS["camera"], MOUNTS[sensor]
    base = points[:, :3].astype(float) @ matrix(q).T + t
    x, y, z = ((base - camera_t) @ matrix(camera_q)).T
    xn, yn = x / z, y / z
    r2 = xn * xn + yn * yn
    radial = 1 + D[0] * r2 + D[1] * r2**2 + D[4] * r2**3
    xd = xn * radial + 2 * D[2] * xn * yn + D[3] * (r2 + 2 * xn * xn)
    yd = yn * radial + D[2] * (r2 + 2 * yn * yn) + 2 * D[3] * xn * yn
    u = (K[0] * xd + K[2]) * STORED[0] / WIDTH
    v = (K[4] * yd + K[5]) * STORED[1] / HEIGHT
    seen = numpy.flatnonzero((z > 0.5) & (u >= 0) & (v >= 0) & (u < STORED[0]) & (v < STORED[1]))
    pixel = numpy.floor(v[seen]).astype(int) * STORED[0] + numpy.floor(u[seen]).astype(int)
    far = (x * x + y * y + z * z)[seen]
    order = numpy.lexsort((far, pixel))
    _, first = numpy.unique(pixel[order], return_index=True)
    rows = seen[order[first]]
    return numpy.sort(numpy.unique(pixel)), numpy.stack([x, y, z], axis=1)[rows], rows


def drive():
    """(seconds, signal, value) in order."""
    events = []
    for step in range(int(SECONDS * 50) + 1):
        t = step / 50
        yaw = SPEED / RADIUS * t
        events.append((t, "odometry", (RADIUS * sin(yaw), RADIUS * (1 - cos(yaw)), yaw)))
    for step in range(int(SECONDS * 10) + 1):
        t = step / 10
        picture = io.BytesIO()
        Image.new("RGB", (WIDTH, HEIGHT), (40 + 4 * step, 90, 160)).save(picture, "jpeg")
        events.append((t, "camera", picture.getvalue()))
        events.append((t, "lidar", cloud(300, "x y z intensity".split())))
        events.append((t, "radar", cloud(40, "x y z velocity".split())))
    return sorted(events, key=lambda event: event[0])


def facts(events):
    ticks = [{} for _ in range(11)]
    for t, signal, value in events:
        tick = round(t * 10)
        if abs(t * 10 - tick) > 1e-9 or tick > 10:
            continue
        fact = ticks[tick]
        if signal == "odometry":
            fact["position"], fact["yaw"] = [value[0], value[1], 0.0], value[2]
        elif signal in ("lidar", "radar"):
            pixel, xyz, rows = pixels(value[0], signal)
            fact[f"{signal}_pixel"] = pixel.tolist()
            if signal == "lidar":
                fact["lidar_xyz"] = xyz.astype(numpy.float16).astype(float).tolist()
            else:
                fact["radar_speed"] = value[0][rows, 3].astype(numpy.float16).astype(float).tolist()
    return {"speed": SPEED, "yaw_rate": SPEED / RADIUS, "ticks": ticks}


# --- ROS messages as parts, made into messages by the package that writes them.


def vector(x, y, z):
    return Part(x=float(x), y=float(y), z=float(z))


def quaternion(q):
    return Part(x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3]))


def ros_messages(t, signal, value, stamp):
    """Topic, type and message for an event."""
    head = lambda frame: Part(stamp=stamp(t), frame_id=frame)
    if signal == "camera":
        yield "/camera/image/compressed", "sensor_msgs/msg/CompressedImage", Part(
            header=head("camera"), format="jpeg", data=numpy.frombuffer(value, numpy.uint8))
        yield "/camera/camera_info", "sensor_msgs/msg/CameraInfo", Part(
            header=head("camera"), height=HEIGHT, width=WIDTH, distortion_model="plumb_bob",
            d=numpy.array(D), k=numpy.array(K), r=numpy.eye(3).ravel(), p=numpy.zeros(12), binning_x=0, binning_y=0,
            roi=Part(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False))
    elif signal in ("lidar", "radar"):
        points, names = value
        fields = [Part(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate(names)]
        yield f"/{signal}/points", "sensor_msgs/msg/PointCloud2", Part(
            header=head(signal), height=1, width=len(points), fields=fields, is_bigendian=False, point_step=16,
            row_step=points.nbytes, data=numpy.frombuffer(points.tobytes(), numpy.uint8), is_dense=True)
    else:
        x, y, yaw = value
        zeros = numpy.zeros(36)
        pose = Part(pose=Part(position=vector(x, y, 0), orientation=quaternion(about([0, 0, 1], yaw))), covariance=zeros)
        twist = Part(twist=Part(linear=vector(SPEED, 0, 0), angular=vector(0, 0, SPEED / RADIUS)), covariance=zeros)
        yield "/odom", "nav_msgs/msg/Odometry", Part(header=head("odom"), child_frame_id="base_link", pose=pose, twist=twist)


def static_transforms(stamp):
    return Part(transforms=[
        Part(header=Part(stamp=stamp(0), frame_id="base_link"), child_frame_id=child,
             transform=Part(translation=vector(*t), rotation=quaternion(q)))
        for child, (t, q) in MOUNTS.items()])


def rosbags_message(store, kind, part):
    """A Part as the dataclass that rosbags has for its type."""
    values = {}
    for field, (node, detail) in store.fielddefs[kind][1]:
        name = field.lower() if field in ("K", "D", "R", "P") else field
        value = getattr(part, name, 0)
        if int(node) == 2:
            value = rosbags_message(store, detail, value)
        elif int(node) > 2 and int(detail[0][0]) == 2:
            value = [rosbags_message(store, detail[0][1], item) for item in value]
        values[field] = value
    return store.types[kind](**values)


def write_rosbags(events, path, ros):
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE if ros == 2 else Stores.ROS1_NOETIC)
    if ros == 1:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    serialize = store.serialize_cdr if ros == 2 else store.serialize_ros1
    stamp = lambda t: Part(sec=(START_NS + round(t * 1e9)) // 10**9, nanosec=(START_NS + round(t * 1e9)) % 10**9)
    channels = {}
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()

        def write(t, topic, kind, part):
            if topic not in channels:
                text, _ = store.generate_msgdef(kind, ros_version=ros)
                name = kind if ros == 2 else kind.replace("/msg/", "/")
                schema = writer.register_schema(name, f"ros{ros}msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr" if ros == 2 else "ros1", schema)
            ns = START_NS + round(t * 1e9)
            writer.add_message(channels[topic], ns, bytes(serialize(rosbags_message(store, kind, part), kind)), ns)

        write(0, "/tf_static", "tf2_msgs/msg/TFMessage", static_transforms(stamp))
        for event in events:
            for topic, kind, part in ros_messages(*event, stamp):
                write(event[0], topic, kind, part)
        writer.finish()


def plain(part):
    """A Part without numpy's arrays, which mcap-ros2-support does not take."""
    if isinstance(part, Part):
        return Part(**{name: plain(value) for name, value in vars(part).items()})
    if isinstance(part, numpy.ndarray):
        return part.tobytes() if part.dtype == numpy.uint8 else part.tolist()
    return [plain(item) for item in part] if isinstance(part, list) else part


def write_mcap_ros2(events, path):
    from mcap_ros2.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)  # For the definitions' texts alone.
    stamp = lambda t: Part(sec=(START_NS + round(t * 1e9)) // 10**9, nanosec=(START_NS + round(t * 1e9)) % 10**9)
    schemas = {}
    with open(path, "wb") as file:
        writer = Writer(file)

        def write(t, topic, kind, part):
            if kind not in schemas:
                text, _ = store.generate_msgdef(kind, ros_version=2)
                schemas[kind] = writer.register_msgdef(kind, text)
            ns = START_NS + round(t * 1e9)
            writer.write_message(topic, schemas[kind], plain(part), log_time=ns, publish_time=ns)

        write(0, "/tf_static", "tf2_msgs/msg/TFMessage", static_transforms(stamp))
        for event in events:
            for topic, kind, part in ros_messages(*event, stamp):
                write(event[0], topic, kind, part)
        writer.finish()


# --- Foxglove's types, by the SDK and by protobuf's own classes; the two differ in spelling only.


def write_foxglove(events, path, make, log):
    """`make(type, **fields)` makes a message, `log(topic, message, ns)` writes it."""
    at = lambda t: START_NS + round(t * 1e9)
    three = lambda x, y, z: make("Vector3", x=float(x), y=float(y), z=float(z))
    turn = lambda q: make("Quaternion", x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3]))
    transforms = [
        make("FrameTransform", timestamp=at(0), parent_frame_id="base_link", child_frame_id=child, translation=three(*t), rotation=turn(q))
        for child, (t, q) in MOUNTS.items()]
    log("/tf_static", make("FrameTransforms", transforms=transforms), at(0))
    for t, signal, value in events:
        ns = at(t)
        if signal == "camera":
            log("/camera/image", make("CompressedImage", timestamp=ns, frame_id="camera", data=value, format="jpeg"), ns)
            log("/camera/calibration", make(
                "CameraCalibration", timestamp=ns, frame_id="camera", width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=D, K=K), ns)
        elif signal in ("lidar", "radar"):
            points, names = value
            fields = [make("PackedElementField", name=name, offset=4 * i, type=7) for i, name in enumerate(names)]
            log(f"/{signal}", make("PointCloud", timestamp=ns, frame_id=signal, point_stride=16, fields=fields, data=points.tobytes()), ns)
        else:
            x, y, yaw = value
            pose = make("Pose", position=three(x, y, 0), orientation=turn(about([0, 0, 1], yaw)))
            log("/pose", make("PoseInFrame", timestamp=ns, frame_id="odom", pose=pose), ns)


def write_protobuf(events, path):
    import importlib

    from google.protobuf.timestamp_pb2 import Timestamp
    from mcap_protobuf.writer import Writer

    def make(kind, **fields):
        if "timestamp" in fields:
            ns = fields["timestamp"]
            fields["timestamp"] = Timestamp(seconds=ns // 10**9, nanos=ns % 10**9)
        module = "PackedElementField" if kind == "PackedElementField" else kind
        return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{module}_pb2"), kind)(**fields)

    with open(path, "wb") as file, Writer(file) as writer:
        write_foxglove(events, path, make, lambda topic, message, ns: writer.write_message(topic, message, ns, ns))


def write_sdk(events, path):
    import foxglove
    from foxglove import messages

    def make(kind, **fields):
        if "timestamp" in fields:
            ns = fields["timestamp"]
            fields["timestamp"] = messages.Timestamp(ns // 10**9, ns % 10**9)
        if kind == "PackedElementField":
            fields["type"] = messages.PackedElementFieldNumericType.Float32
        return getattr(messages, kind)(**fields)

    with foxglove.open_mcap(path, allow_overwrite=True):
        write_foxglove(events, path, make, lambda topic, message, ns: foxglove.log(topic, message, log_time=ns))


def main():
    writer, path = sys.argv[1:]
    events = drive()
    {
        "rosbags-ros2": lambda: write_rosbags(events, path, 2),
        "rosbags-ros1": lambda: write_rosbags(events, path, 1),
        "mcap-ros2-support": lambda: write_mcap_ros2(events, path),
        "mcap-protobuf-support": lambda: write_protobuf(events, path),
        "foxglove-sdk": lambda: write_sdk(events, path),
    }[writer]()
    print(json.dumps(facts(events)))


main()
