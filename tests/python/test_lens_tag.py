"""The focal length that phones and cameras write into films, read and used as a prior."""

import struct

import av
import numpy as np
import pytest

from gait.io.lens_tag import equivalent_mm, lens_tag, view_across
from gait.io.video import Video
from gait.track.walk_camera import expected_fov

KEY = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
SIZE = (64, 48)


def film(path, tag=None):
    """Write a film of three black pictures with a tag of the whole film."""
    options = {} if path.suffix == ".mkv" else {"movflags": "use_metadata_tags"}
    with av.open(str(path), "w", options=options) as out:
        if tag is not None:
            out.metadata[KEY] = tag
        stream = out.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for _ in range(3):
            picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
            out.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        out.mux(stream.encode(None))
    return path


def box(kind, *parts):
    data = b"".join(parts)
    return struct.pack(">I4s", 8 + len(data), kind) + data


def track_meta(value, kind=1, version=b""):
    """Metadata of a track as phones write it: `version` exists in MP4, not in QuickTime."""
    names = b"".join(box(b"mdta", name.encode()) for name in ("com.apple.quicktime.camera.lens_model", KEY))
    items = [
        box(struct.pack(">I", number), box(b"data", struct.pack(">II", kind_, 0), data))
        for number, kind_, data in ((1, 1, b"iPhone back camera 5.1mm"), (2, kind, value))
    ]
    handler = box(b"hdlr", bytes(24))
    return box(b"meta", version, handler, box(b"keys", struct.pack(">II", 0, 2), names), box(b"ilst", *items))


def put_into_track(path, meta):
    """Append a box to the only track of a film whose index is at its end."""
    data = path.read_bytes()
    at = 0
    while data[at + 4 : at + 8] != b"moov":
        at += struct.unpack_from(">I", data, at)[0]
    moov = data[at + 8 : at + struct.unpack_from(">I", data, at)[0]]
    parts, k = [], 0
    while k < len(moov):
        size = struct.unpack_from(">I", moov, k)[0]
        part = moov[k : k + size]
        parts.append(box(b"trak", part[8:], meta) if part[4:8] == b"trak" else part)
        k += size
    path.write_bytes(data[:at] + box(b"moov", *parts))
    return path


def jpeg_film(path, mm, order):
    """Write a film of JPEGs with the EXIF of a camera."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream("mjpeg", rate=5)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuvj420p"
        picture = av.VideoFrame.from_ndarray(np.zeros((SIZE[1], SIZE[0], 3), np.uint8), format="bgr24")
        (packet,) = stream.encode(picture)
        entry = struct.Struct(order + "HHI")
        exif_at = 8 + 2 + 12 + 4
        tiff = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 8)
        tiff += struct.pack(order + "H", 1) + entry.pack(0x8769, 4, 1) + struct.pack(order + "II", exif_at, 0)
        tiff += struct.pack(order + "H", 1) + entry.pack(0xA405, 3, 1) + struct.pack(order + "HHI", mm, 0, 0)
        segment = b"Exif\0\0" + tiff
        data = bytes(packet)
        data = data[:2] + b"\xff\xe1" + struct.pack(">H", 2 + len(segment)) + segment + data[2:]
        for k in range(3):
            copy = av.Packet(data)
            copy.pts = copy.dts = k
            copy.stream, copy.time_base = stream, packet.time_base
            out.mux(copy)
    return path


@pytest.mark.parametrize("suffix", [".mov", ".mp4", ".mkv"])
def test_a_tag_of_the_film(tmp_path, suffix):
    assert lens_tag(film(tmp_path / f"a{suffix}", "26.00mm")) == "26.00mm"
    assert lens_tag(film(tmp_path / f"b{suffix}")) is None


@pytest.mark.parametrize(
    ("value", "kind", "version"),
    [(b"27.00mm", 1, b""), (struct.pack(">i", 27), 21, bytes(4)), (struct.pack(">d", 27.0), 24, b"")],
    ids=["text", "integer in MP4", "float"],
)
def test_a_tag_of_a_track(tmp_path, value, kind, version):
    path = put_into_track(film(tmp_path / "a.mov"), track_meta(value, kind, version))
    assert equivalent_mm(lens_tag(path)) == 27.0
    assert Video(path).count == 3


@pytest.mark.parametrize("order", "<>")
def test_the_exif_of_pictures(tmp_path, order):
    assert lens_tag(jpeg_film(tmp_path / "a.mkv", 28, order)) == "28"


def test_damaged_metadata_counts_as_none(tmp_path):
    meta = track_meta(b"27.00mm")
    for damaged in (meta[:-20], box(b"meta", b"\xff" * 40), meta.replace(b"data", b"dat\0")):
        path = put_into_track(film(tmp_path / "a.mov"), damaged)
        assert lens_tag(path) is None
    assert lens_tag(jpeg_film(tmp_path / "b.mkv", 0, "<")) == "0"


@pytest.mark.parametrize(
    ("tag", "mm"),
    [
        *(("26.00mm", 26.0), ("28", 28.0), (" 13.5 mm ", 13.5)),
        *(("0.00mm", None), ("-26mm", None), ("nanmm", None), ("26in", None), ("", None), ("1e9", None)),
        ("4000", None),
    ],
)
def test_nonsense_is_no_focal_length(tag, mm):
    assert equivalent_mm(tag) == mm


def test_equivalent_lengths_share_the_diagonal():
    assert view_across(43.2666, (4000, 3000)) == pytest.approx(2 * np.degrees(np.arctan(0.4)), abs=1e-3)
    assert view_across(26.0, (1080, 1920)) < view_across(26.0, (1920, 1080))


def test_the_tag_is_a_prior_and_the_users_view_wins(tmp_path, capsys):
    video = Video(film(tmp_path / "a.mov", "26.00mm"))
    fov, sd = expected_fov(video, None, quiet=False)
    assert fov == pytest.approx(view_across(26.0, SIZE)) and 0.05 < sd < 0.45
    assert capsys.readouterr().err.count("\n") == 1
    assert expected_fov(video, 50.0, quiet=False)[0] == 50.0
    assert not capsys.readouterr().err
    assert expected_fov(Video(film(tmp_path / "b.mov", "-1.00mm")), None, quiet=False)[0] is None
    assert "states a focal length of '-1.00mm', which is not one" in capsys.readouterr().err
