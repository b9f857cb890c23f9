"""Pictures made and read by OpenCV and Pillow, one JSON object a line: bytes and what they show."""

import io
import json

import cv2
import numpy as np
from PIL import Image

W, H = 64, 48
y, x = np.mgrid[0:H, 0:W]
shade = 110 + 70 * np.sin(x / 17) * np.cos(y / 11)
rgb = np.stack([shade + 20, shade, 0.6 * shade + 40], -1).clip(0, 255).astype(np.uint8)


def tell(name, data, shows, most, encoding=None, step=0, border=0):
    print(json.dumps(dict(
        name=name, data=bytes(data).hex(), rgb=np.ascontiguousarray(shows).tobytes().hex(),
        width=W, height=H, encoding=encoding, step=step, most=most, border=border)))


def file(image, form, **options):
    out = io.BytesIO()
    image.save(out, form, **options)
    return out.getvalue()


def shown(data):
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


colour = Image.fromarray(rgb)
for form, options, most in [
    ("JPEG", dict(quality=90, subsampling=0), 3),
    ("JPEG", dict(quality=90, subsampling=2), 6),
    ("JPEG", dict(quality=90, subsampling=0, progressive=True), 3),
    ("PNG", {}, 0),
    ("WEBP", dict(lossless=True), 0),
    ("WEBP", dict(quality=90), 3),
]:
    data = file(colour, form, **options)
    tell(f"{form} {options}", data, shown(data), most)
grey = file(colour.convert("L"), "JPEG", quality=90)
tell("grey JPEG", grey, shown(grey), 2)

# Luma and colour differences: OpenCV's I420, laid out anew.
i420 = cv2.cvtColor(rgb, cv2.COLOR_RGB2YUV_I420).reshape(-1)
luma = i420[: W * H]
cb, cr = i420[W * H :].reshape(2, -1)
nv12 = np.concatenate([luma, np.stack([cb, cr], -1).reshape(-1)])
nv21 = np.concatenate([luma, np.stack([cr, cb], -1).reshape(-1)])
for name, data, code in [
    ("i420", i420, cv2.COLOR_YUV2RGB_I420),
    ("nv12", nv12, cv2.COLOR_YUV2RGB_NV12),
    ("nv21", nv21, cv2.COLOR_YUV2RGB_NV21),
]:
    tell(name, data, cv2.cvtColor(data.reshape(-1, W), code), 2, name, W)
wide = np.repeat(np.stack([cb, cr], -1).reshape(H // 2, W // 2, 2), 2, axis=0)
pairs = luma.reshape(H, W // 2, 2)
uyvy = np.stack([wide[..., 0], pairs[..., 0], wide[..., 1], pairs[..., 1]], -1)
yuyv = np.stack([pairs[..., 0], wide[..., 0], pairs[..., 1], wide[..., 1]], -1)
for name, data, code in [
    ("yuv422", uyvy, cv2.COLOR_YUV2RGB_UYVY),
    ("yuv422_yuy2", yuyv, cv2.COLOR_YUV2RGB_YUY2),
]:
    tell(name, data, cv2.cvtColor(data.reshape(H, W, 2), code), 2, name, 2 * W)

# OpenCV names a mosaic after its second row and column: its BayerBG is RGGB.
for name, code in [
    ("rggb", cv2.COLOR_BayerBG2RGB),
    ("bggr", cv2.COLOR_BayerRG2RGB),
    ("gbrg", cv2.COLOR_BayerGR2RGB),
    ("grbg", cv2.COLOR_BayerGB2RGB),
]:
    mosaic = np.zeros((H, W), np.uint8)
    for at, letter in enumerate(name):
        row, column = divmod(at, 2)
        mosaic[row::2, column::2] = rgb[row::2, column::2, "rgb".index(letter)]
    tell(f"bayer {name}", mosaic, cv2.cvtColor(mosaic, code), 1, f"bayer_{name}8", W, 1)
mono16 = (rgb[..., 0].astype(np.uint16) * 257)
scaled = cv2.convertScaleAbs(mono16, alpha=255 / 65535)
tell("mono16", mono16.tobytes(), np.repeat(scaled[..., None], 3, -1), 0, "mono16", 2 * W)
